# Helpers of tests, fuzz targets and benchmarks, test/support/*.cpp: compiled once, and optimized as
# the core is. Those that expect something with GoogleTest are for tests only (cmake/tests.cmake).

file(GLOB test_helper_sources CONFIGURE_DEPENDS RELATIVE ${CMAKE_CURRENT_SOURCE_DIR} test/support/*.cpp)
set(gtest_helper_sources "")
foreach(source IN LISTS test_helper_sources)
  file(STRINGS ${source} gtest REGEX "<gtest/gtest.h>" LIMIT_COUNT 1)
  if(gtest)
    list(APPEND gtest_helper_sources ${source})
  endif()
endforeach()
list(REMOVE_ITEM test_helper_sources ${gtest_helper_sources})

ist_proximity_units(test_helper_units ${test_helper_sources})
add_library(test_helpers STATIC EXCLUDE_FROM_ALL ${test_helper_units})
set_target_properties(test_helpers PROPERTIES
  ARCHIVE_OUTPUT_DIRECTORY ${CMAKE_CURRENT_BINARY_DIR}/test)
target_include_directories(test_helpers PUBLIC
  ${CMAKE_CURRENT_SOURCE_DIR}/test ${CMAKE_CURRENT_SOURCE_DIR}/src)
target_link_libraries(test_helpers PUBLIC ist_proximity_core)
# Where they find demo/ and, unless the environment variable IST_PROXIMITY_DATA says otherwise,
# ../shared/data.
target_compile_definitions(test_helpers PUBLIC
  IST_PROXIMITY_SOURCE_DIR="${CMAKE_CURRENT_SOURCE_DIR}")
if(CMAKE_CXX_COMPILER_ID STREQUAL "GNU")
  # False alarms: of a std::variant on the stack GCC 12 thinks that every alternative is destroyed.
  target_compile_options(test_helpers PRIVATE -Wno-free-nonheap-object -Wno-maybe-uninitialized)
endif()
