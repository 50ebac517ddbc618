#pragma once

#include <gtest/gtest.h>

#include <stdexcept>
#include <string>

#include "ist_proximity/geometry/error.h"

/// Messages of errors.
namespace ist::test {

inline void expect_says(const std::string& text, const std::string& part) {
  EXPECT_NE(text.find(part), std::string::npos) << text << "\n  lacks: " << part;
}

/// The message of the ModelError that a call throws.
template <class Call>
std::string error_of(const Call& call) {
  try {
    call();
  } catch (const ModelError& error) {
    return error.what();
  }
  return "(no error)";
}

/// The message of the std::invalid_argument that a call throws.
template <class Call>
std::string argument_error(const Call& call) {
  try {
    call();
  } catch (const std::invalid_argument& error) {
    return error.what();
  }
  return "(no error)";
}

}  // namespace ist::test
