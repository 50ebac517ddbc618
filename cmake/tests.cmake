# Core tests: one GoogleTest program per test/core/*_test.cpp, no ROS. ROS tests: rostest files.
#
# With catkin they are known to `ctest` and to `make run_tests`, and built by `make tests` only.
# Results go as XML to test_results/ in the build folder.

find_package(GTest QUIET)
if(NOT GTEST_FOUND AND NOT GTest_FOUND)
  message(STATUS "ist_proximity: no tests, GoogleTest is missing (apt install libgtest-dev)")
  return()
endif()

file(GLOB core_test_sources CONFIGURE_DEPENDS test/core/*_test.cpp)
set(results_dir ${CMAKE_BINARY_DIR}/test_results/${PROJECT_NAME})

# What every test program links: helpers, the core and GoogleTest.
add_library(test_support STATIC EXCLUDE_FROM_ALL ${gtest_helper_sources})
set_target_properties(test_support PROPERTIES
  ARCHIVE_OUTPUT_DIRECTORY ${CMAKE_CURRENT_BINARY_DIR}/test)
# False alarms of GCC: an EXPECT in an `if` without braces is safe, GoogleTest sees to that; and of
# a std::variant on the stack GCC 12 thinks that every alternative is destroyed.
target_compile_options(test_support PUBLIC -Wno-dangling-else)
if(CMAKE_CXX_COMPILER_ID STREQUAL "GNU")
  target_compile_options(test_support PUBLIC -Wno-free-nonheap-object -Wno-maybe-uninitialized)
endif()
# Highway: one test goes through the instruction sets.
target_link_libraries(test_support PUBLIC
  test_helpers ist_proximity_core ist_proximity::hwy GTest::GTest)

# The libraries whose types users have in hand. The tests of their headers need them, and nothing else.
find_path(OCTOMAP_INCLUDE_DIR octomap/octomap.h)
find_library(OCTOMAP_LIBRARY octomap)
find_library(OCTOMATH_LIBRARY octomath)
mark_as_advanced(OCTOMAP_INCLUDE_DIR OCTOMAP_LIBRARY OCTOMATH_LIBRARY)
set(octomap_FOUND OFF)
if(OCTOMAP_INCLUDE_DIR AND OCTOMAP_LIBRARY AND OCTOMATH_LIBRARY)
  set(octomap_FOUND ON)
else()
  message(STATUS "ist_proximity: no octomap_test, octree_test and memory_octomap_test, OctoMap is missing (apt install liboctomap-dev)")
endif()
# Not find_package(PCL): it looks for VTK, OpenNI and Qt, too, which takes longer than all the rest.
find_path(PCL_INCLUDE_DIR pcl/point_cloud.h
  PATH_SUFFIXES pcl-1.15 pcl-1.14 pcl-1.13 pcl-1.12 pcl-1.11 pcl-1.10)
find_library(PCL_COMMON_LIBRARY pcl_common)
find_library(PCL_IO_LIBRARY pcl_io)
find_library(PCL_IO_PLY_LIBRARY pcl_io_ply)
mark_as_advanced(PCL_INCLUDE_DIR PCL_COMMON_LIBRARY PCL_IO_LIBRARY PCL_IO_PLY_LIBRARY)
set(pcl_FOUND OFF)
if(PCL_INCLUDE_DIR AND PCL_COMMON_LIBRARY AND PCL_IO_LIBRARY AND PCL_IO_PLY_LIBRARY)
  set(pcl_FOUND ON)
else()
  message(STATUS "ist_proximity: no pcl_test, PCL is missing (apt install libpcl-dev)")
endif()

# ist_proximity_cost(TEST [NAME SECONDS]...): those that take long start first, so that none is left
# running alone at the end. `ctest` knows by itself only after a first run.
function(ist_proximity_cost test)
  while(ARGN)
    list(POP_FRONT ARGN name seconds)
    if(test MATCHES "(^|_)${name}(_test|\\.test)?$")
      set_tests_properties(${test} PROPERTIES COST ${seconds})
    endif()
  endwhile()
endfunction()

# ist_proximity_gtest(TARGET [ARGUMENT...]): makes a GoogleTest program a core test.
function(ist_proximity_gtest test)
  set_target_properties(${test} PROPERTIES
    RUNTIME_OUTPUT_DIRECTORY ${CMAKE_CURRENT_BINARY_DIR}/test)
  set(arguments --gtest_output=xml:${results_dir}/gtest-${test}.xml ${ARGN})
  if(catkin_FOUND)
    set_target_properties(${test} PROPERTIES EXCLUDE_FROM_ALL ON)
    add_dependencies(tests ${test})
    list(JOIN arguments " " arguments)
    catkin_run_tests_target(gtest ${test} gtest-${test}.xml
      COMMAND "${CMAKE_CURRENT_BINARY_DIR}/test/${test} ${arguments}" DEPENDENCIES ${test})
    set(ctest_name _ctest_${PROJECT_NAME}_gtest_${test})
  else()
    add_test(NAME ${test} COMMAND ${test} ${arguments})
    set(ctest_name ${test})
  endif()
  set(timeout 600)
  if(IST_PROXIMITY_SANITIZE)
    set(timeout 3600)  # packing takes thirty times as long
  endif()
  set_tests_properties(${ctest_name} PROPERTIES LABELS core TIMEOUT ${timeout})
  ist_proximity_cost(${ctest_name}
    packer 30 accuracy_doc 25 closed_loop 20 contact_known 16 link_pair_exact 13 contact_of_links 12)
endfunction()

# Read once for all tests: half of the compiler's work.
set(test_headers
  <gtest/gtest.h> <Eigen/Core> <Eigen/Geometry>
  <algorithm> <functional> <map> <memory> <random> <string> <thread> <variant> <vector>
  <support/meshes.h> <support/random_links.h> <support/scene.h> <support/shape_oracle.h>
  <ist_proximity/cloud/ingest.h> <ist_proximity/proximity/proximity_query.h>
  <ist_proximity/robot/robot_model.h>)

set(first_test "")
foreach(source IN LISTS core_test_sources)
  if(IST_PROXIMITY_SANITIZE STREQUAL "thread")
    # Only tests that start threads have anything to show.
    file(STRINGS ${source} threads REGEX "<atomic>|<future>|<thread>|threads" LIMIT_COUNT 1)
    if(NOT threads)
      continue()
    endif()
  endif()
  get_filename_component(test ${source} NAME_WE)
  if((test MATCHES "^(octomap|octree|memory_octomap)_test$" AND NOT octomap_FOUND) OR
     (test STREQUAL "pcl_test" AND NOT pcl_FOUND) OR
     (test STREQUAL "pack_robot_test" AND NOT TARGET pack_robot))
    continue()
  endif()
  add_executable(${test} ${source})
  target_link_libraries(${test} PRIVATE test_support GTest::Main)
  if(CMAKE_CXX_COMPILER_ID STREQUAL "GNU" AND NOT IST_PROXIMITY_SANITIZE)
    # A quarter of the compiler's work. The core and the helpers, where tests spend their time, are
    # optimized fully.
    target_compile_options(${test} PRIVATE -O1)
  endif()
  if(NOT first_test)
    target_precompile_headers(${test} PRIVATE ${test_headers})
    set(first_test ${test})
  else()
    target_precompile_headers(${test} REUSE_FROM ${first_test})
  endif()
  if(test MATCHES "^(closed_loop|closing_speed|dodge_controller|simulator)_test$")
    target_link_libraries(${test} PRIVATE ist_proximity_simulator)
  endif()
  if(test STREQUAL "pcl_test")
    target_include_directories(${test} SYSTEM PRIVATE ${PCL_INCLUDE_DIR})
    target_link_libraries(${test} PRIVATE
      ${PCL_IO_LIBRARY} ${PCL_IO_PLY_LIBRARY} ${PCL_COMMON_LIBRARY})
  endif()
  if(test MATCHES "^(octomap|octree|memory_octomap)_test$")
    target_include_directories(${test} SYSTEM PRIVATE ${OCTOMAP_INCLUDE_DIR})
    target_link_libraries(${test} PRIVATE ${OCTOMAP_LIBRARY} ${OCTOMATH_LIBRARY})
  endif()
  ist_proximity_gtest(${test})
endforeach()

if(TARGET pack_robot_test)
  add_dependencies(pack_robot_test pack_robot)
  target_compile_definitions(pack_robot_test PRIVATE
    IST_PROXIMITY_PACK_ROBOT="$<TARGET_FILE:pack_robot>")
endif()

# Tests of the ROS rooms that need no master: one GoogleTest program per test/ros/*_test.cpp.
if(catkin_FOUND AND TARGET ist_proximity_ros)
  file(GLOB ros_test_sources CONFIGURE_DEPENDS test/ros/*_test.cpp)
  foreach(source IN LISTS ros_test_sources)
    get_filename_component(test ${source} NAME_WE)
    add_executable(${test} EXCLUDE_FROM_ALL ${source})
    target_include_directories(${test} SYSTEM PRIVATE ${catkin_INCLUDE_DIRS})
    target_link_libraries(${test} PRIVATE
      test_helpers ist_proximity_ros GTest::GTest GTest::Main)
    if(CMAKE_CXX_COMPILER_ID STREQUAL "GNU" AND NOT IST_PROXIMITY_SANITIZE)
      target_compile_options(${test} PRIVATE -O1)  # as the core's
    endif()
    set_target_properties(${test} PROPERTIES
      RUNTIME_OUTPUT_DIRECTORY ${CMAKE_CURRENT_BINARY_DIR}/test)
    add_dependencies(tests ${test})
    set(arguments --gtest_output=xml:${results_dir}/gtest-${test}.xml)
    catkin_run_tests_target(gtest ${test} gtest-${test}.xml
      COMMAND "${CMAKE_CURRENT_BINARY_DIR}/test/${test} ${arguments}" DEPENDENCIES ${test})
    set_tests_properties(_ctest_${PROJECT_NAME}_gtest_${test} PROPERTIES LABELS core TIMEOUT 600)
  endforeach()
endif()

# The node without any add-on.
if(catkin_FOUND AND TARGET ist_proximity_ros)
  ist_proximity_add_on_table(no_add_ons)
  add_executable(test_bare_node EXCLUDE_FROM_ALL
    src/nodes/proximity_node.cpp ${no_add_ons} $<TARGET_OBJECTS:ist_proximity_ros_objects>)
  target_include_directories(test_bare_node PRIVATE src)
  target_include_directories(test_bare_node SYSTEM PRIVATE ${catkin_INCLUDE_DIRS})
  target_link_libraries(test_bare_node PRIVATE ist_proximity_core ${catkin_LIBRARIES})
  add_dependencies(tests test_bare_node)
endif()

if(catkin_FOUND)
  find_package(rostest QUIET)
endif()
if(rostest_FOUND)
  file(GLOB rostests CONFIGURE_DEPENDS RELATIVE ${CMAKE_CURRENT_SOURCE_DIR} test/ros/*.test)
  foreach(file IN LISTS rostests)
    add_rostest(${file} DEPENDENCIES
      proximity_node velocity_filter_node ist_proximity_nodelet simulator_node dodge_node
      test_bare_node)
    string(REPLACE "/" "_" test ${file})
    # They wait for what the node says, and judge it by stamps and counts. Demos, in which robots move
    # in real time, and pairs of options, of which every message counts, run alone.
    set(serial OFF)
    if(test MATCHES "^test_ros_(demo|dodge|pairs)\\.test$")
      set(serial ON)
    endif()
    set(name _ctest_${PROJECT_NAME}_rostest_${test})
    set_tests_properties(${name} PROPERTIES LABELS ros TIMEOUT 600 RUN_SERIAL ${serial})
    ist_proximity_cost(${name}
      query 70 parameters 65 velocity_filter 60 contract 50 names 50 laser_scan 50 bad_input 45
      world 45 diagnostics 45 joint_states 35 memory 35)
  endforeach()
endif()

if(catkin_FOUND AND IST_PROXIMITY_SANITIZE)
  add_executable(test_nodelet_manager EXCLUDE_FROM_ALL test/soak/nodelet_manager.cpp)
  target_link_libraries(test_nodelet_manager PRIVATE -Wl,--no-as-needed ist_proximity_ros)
  target_include_directories(test_nodelet_manager SYSTEM PRIVATE ${catkin_INCLUDE_DIRS})
  set_target_properties(test_nodelet_manager PROPERTIES
    OUTPUT_NAME nodelet_manager RUNTIME_OUTPUT_DIRECTORY ${CMAKE_CURRENT_BINARY_DIR}/test)
endif()
