# Fuzz targets: each fuzz/*.cpp is a program that takes bytes, see CONTRIBUTING.md.
#
# With IST_PROXIMITY_FUZZ (clang) libFuzzer gives the bytes, and scripts/fuzz runs it. Otherwise each
# is a core test that gives it the kept seeds, fuzz/seeds/<target>/. Those in fuzz/ros need ROS.

file(GLOB fuzz_sources CONFIGURE_DEPENDS fuzz/*.cpp)
if(catkin_FOUND)
  file(GLOB ros_fuzz_sources CONFIGURE_DEPENDS fuzz/ros/*.cpp)
  list(APPEND fuzz_sources ${ros_fuzz_sources})
endif()

add_library(fuzz_support INTERFACE)
target_include_directories(fuzz_support INTERFACE ${CMAKE_CURRENT_SOURCE_DIR}/fuzz)
target_link_libraries(fuzz_support INTERFACE
  test_helpers ist_proximity_core ist_proximity::xxhash)
if(CMAKE_CXX_COMPILER_ID STREQUAL "GNU")
  # A false alarm of GCC 12, as in the tests: of a std::variant it thinks that all are destroyed.
  target_compile_options(fuzz_support INTERFACE -Wno-maybe-uninitialized -Wno-free-nonheap-object)
endif()

# What the targets in fuzz/ros run: with libFuzzer no more than that is built.
set(fuzz_ros ist_proximity_ros)
if(catkin_FOUND AND IST_PROXIMITY_FUZZ)
  set(fuzz_ros fuzz_ros_sources)
  file(GLOB sources CONFIGURE_DEPENDS src/ros/common/*.cpp src/ros/parameters/*.cpp)
  add_library(fuzz_ros_sources STATIC EXCLUDE_FROM_ALL
    ${sources} src/ros/services/object_conversion.cpp)
  # roscpp reads numbers where they lie in a message.
  target_compile_options(fuzz_ros_sources PUBLIC -fno-sanitize=alignment)
  target_include_directories(fuzz_ros_sources PRIVATE src)
  target_include_directories(fuzz_ros_sources SYSTEM PRIVATE ${catkin_INCLUDE_DIRS})
  target_link_libraries(fuzz_ros_sources PUBLIC ist_proximity_core ${catkin_LIBRARIES})
  add_dependencies(fuzz_ros_sources ${${PROJECT_NAME}_EXPORTED_TARGETS} ${catkin_EXPORTED_TARGETS})
endif()

if(IST_PROXIMITY_FUZZ)
  add_library(fuzz_baseline OBJECT fuzz/support/baseline.cpp)
  target_link_libraries(fuzz_baseline PRIVATE ist_proximity::hwy)
  target_sources(fuzz_support INTERFACE $<TARGET_OBJECTS:fuzz_baseline>)
  target_link_libraries(fuzz_support INTERFACE ist_proximity::hwy -fsanitize=fuzzer)
  add_custom_target(fuzz_targets)
else()
  add_library(fuzz_replay STATIC EXCLUDE_FROM_ALL fuzz/support/replay.cpp)
  set_target_properties(fuzz_replay PROPERTIES
    ARCHIVE_OUTPUT_DIRECTORY ${CMAKE_CURRENT_BINARY_DIR}/test)
  target_include_directories(fuzz_replay PRIVATE fuzz)
  target_link_libraries(fuzz_replay PUBLIC GTest::GTest)
endif()

foreach(source IN LISTS fuzz_sources)
  get_filename_component(name ${source} NAME_WE)
  set(target fuzz_${name})
  add_executable(${target} ${source})
  target_link_libraries(${target} PRIVATE fuzz_support)
  if(source MATCHES "fuzz/ros/")
    target_include_directories(${target} SYSTEM PRIVATE ${catkin_INCLUDE_DIRS})
    target_link_libraries(${target} PRIVATE ${fuzz_ros})
  endif()
  if(IST_PROXIMITY_FUZZ)
    set_target_properties(${target} PROPERTIES
      OUTPUT_NAME ${name} RUNTIME_OUTPUT_DIRECTORY ${CMAKE_CURRENT_BINARY_DIR}/fuzz)
    add_dependencies(fuzz_targets ${target})
  else()
    target_link_libraries(${target} PRIVATE fuzz_replay)
    ist_proximity_gtest(${target} "--seeds=${CMAKE_CURRENT_SOURCE_DIR}/fuzz/seeds/${name}")
  endif()
endforeach()
