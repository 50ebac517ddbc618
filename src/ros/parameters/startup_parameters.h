#pragma once

#include <xmlrpcpp/XmlRpc.h>

#include <map>
#include <string>
#include <vector>

#include "ros/parameters/parameter_reader.h"

namespace ist {

/// Notices changes of parameters that are read at the start only. Not thread safe.
class StartupParameters {
 public:
  /// @param tree  the private namespace, as fetch_parameters() returns it. The first call's values
  ///              are those in use
  /// @param live  parameters that may change at any time
  /// @returns a sentence with each value that has changed or come since; empty when none has. What
  ///          is gone from the server is not named: it is still in use
  std::string changes(const XmlRpc::XmlRpcValue& tree, const std::vector<Tunable>& live);

 private:
  std::map<std::string, std::string> in_use_;  ///< by name
  bool has_begun_ = false;
};

}  // namespace ist
