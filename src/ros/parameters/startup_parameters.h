#pragma once

#include <xmlrpcpp/XmlRpc.h>

#include <map>
#include <string>

namespace ist {

/// Notices changes of parameters that are read at the start only. Not thread safe.
class StartupParameters {
 public:
  /// @param tree  the private namespace, as fetch_parameters() returns it. The first call's values
  ///              are those in use
  /// @returns a sentence with each value that has changed or come since; empty when none has. What
  ///          is gone from the server is not named: it is still in use
  std::string changes(const XmlRpc::XmlRpcValue& tree);

 private:
  std::map<std::string, std::string> in_use_;  ///< by name
  bool has_begun_ = false;
};

}  // namespace ist
