#pragma once

#include <xmlrpcpp/XmlRpcException.h>

#include <exception>
#include <string>

namespace ist {

/// Calls a function that no exception leaves: one that leaves a thread would end the node, and with
/// it everything that is known.
/// @returns empty, or what the exception says
template <typename Function>
std::string exception_of(const Function& function) {
  std::string text;
  try {
    function();
    return text;
  } catch (const XmlRpc::XmlRpcException& error) {  // derived from nothing in some versions
    text = error.getMessage();
  } catch (const std::exception& error) {
    text = error.what();
  } catch (...) {
    text = "an exception of an unknown type";
  }
  return text.empty() ? "an exception without a text" : text;
}

}  // namespace ist
