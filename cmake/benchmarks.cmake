# Programs that measure: one per benchmark/*.cpp, built on demand (target `benchmarks`), not installed.

file(GLOB benchmark_sources CONFIGURE_DEPENDS benchmark/*.cpp)
if(NOT IST_PROXIMITY_CLI11_INCLUDE_DIR)
  list(FILTER benchmark_sources EXCLUDE REGEX "/(hard_cases|near_touch)\\.cpp$")
  message(STATUS "ist_proximity: no benchmark/hard_cases and near_touch, CLI11 is missing "
    "(apt install libcli11-dev)")
endif()
# PCL's filters pull in most of its libraries.
set(pcl_benchmark_libraries "")
foreach(library filters search kdtree io io_ply common)
  find_library(PCL_${library}_LIBRARY pcl_${library})
  mark_as_advanced(PCL_${library}_LIBRARY)
  list(APPEND pcl_benchmark_libraries ${PCL_${library}_LIBRARY})
endforeach()
if(NOT pcl_FOUND OR pcl_benchmark_libraries MATCHES NOTFOUND)
  list(FILTER benchmark_sources EXCLUDE REGEX "/pcl\\.cpp$")
  message(STATUS "ist_proximity: no benchmark/pcl, PCL is missing (apt install libpcl-dev)")
endif()
add_custom_target(benchmarks)
foreach(source IN LISTS benchmark_sources)
  get_filename_component(name ${source} NAME_WE)
  add_executable(benchmark_${name} EXCLUDE_FROM_ALL ${source})
  # They read the test data with the tests' helpers.
  target_include_directories(benchmark_${name} PRIVATE benchmark)
  target_link_libraries(benchmark_${name} PRIVATE
    test_helpers ist_proximity_core ist_proximity::hwy)
  set_target_properties(benchmark_${name} PROPERTIES
    OUTPUT_NAME ${name} RUNTIME_OUTPUT_DIRECTORY ${CMAKE_CURRENT_BINARY_DIR}/benchmark)
  add_dependencies(benchmarks benchmark_${name})
endforeach()

foreach(name closed_loop hidden memory self_view self_contact)
  target_link_libraries(benchmark_${name} PRIVATE ist_proximity_simulator)
endforeach()

if(TARGET benchmark_pcl)
  target_include_directories(benchmark_pcl SYSTEM PRIVATE ${PCL_INCLUDE_DIR})
  target_link_libraries(benchmark_pcl PRIVATE ${pcl_benchmark_libraries})
endif()
if(octomap_FOUND)
  target_compile_definitions(benchmark_memory PRIVATE IST_PROXIMITY_HAS_OCTOMAP)
  target_include_directories(benchmark_memory SYSTEM PRIVATE ${OCTOMAP_INCLUDE_DIR})
  target_link_libraries(benchmark_memory PRIVATE ${OCTOMAP_LIBRARY} ${OCTOMATH_LIBRARY})
endif()

# What links are measured beside, where it is installed.
find_path(FCL_INCLUDE_DIR fcl/fcl.h)
find_library(FCL_LIBRARY fcl)
find_library(CCD_LIBRARY ccd)
mark_as_advanced(FCL_INCLUDE_DIR FCL_LIBRARY CCD_LIBRARY)
if(FCL_INCLUDE_DIR AND FCL_LIBRARY AND CCD_LIBRARY AND octomap_FOUND)
  target_sources(benchmark_link_pairs PRIVATE benchmark/link_pairs/fcl.cpp)
  foreach(name link_pairs world)
    target_compile_definitions(benchmark_${name} PRIVATE IST_PROXIMITY_HAS_FCL)
    target_include_directories(benchmark_${name} SYSTEM PRIVATE
      ${FCL_INCLUDE_DIR} ${OCTOMAP_INCLUDE_DIR})
    target_link_libraries(benchmark_${name} PRIVATE
      ${FCL_LIBRARY} ${CCD_LIBRARY} ${OCTOMAP_LIBRARY} ${OCTOMATH_LIBRARY})
  endforeach()
else()
  message(STATUS "ist_proximity: benchmark/link_pairs and world without FCL (apt install libfcl-dev)")
endif()

if(TARGET benchmark_hard_cases)
  file(GLOB hard_case_sources CONFIGURE_DEPENDS benchmark/hard_cases/*.cpp benchmark/near_touch/*.cpp)
  foreach(name hard_cases near_touch)
    target_sources(benchmark_${name} PRIVATE
      ${hard_case_sources} benchmark/peers/kinect.cpp benchmark/peers/scene.cpp)
    target_include_directories(benchmark_${name} SYSTEM PRIVATE ${IST_PROXIMITY_CLI11_INCLUDE_DIR})
  endforeach()
endif()

# What people would use instead, in benchmark/peers: each where its library is found
# (scripts/install_dependencies benchmark).
target_sources(benchmark_peers PRIVATE
  benchmark/peers/flat.cpp
  benchmark/peers/image_pyramid.cpp
  benchmark/peers/kinect.cpp
  benchmark/peers/ours.cpp
  benchmark/peers/scene.cpp
  benchmark/peers/signed_grid.cpp
  benchmark/peers/synthetic.cpp)
target_sources(benchmark_self_pasted PRIVATE benchmark/peers/kinect.cpp benchmark/peers/scene.cpp)
# ist_proximity_peer(NAME HEADER [LIBRARY...]): compiles benchmark/peers/NAME.cpp where they are.
function(ist_proximity_peer name header)
  find_path(IST_PROXIMITY_${name}_INCLUDE_DIR ${header})
  mark_as_advanced(IST_PROXIMITY_${name}_INCLUDE_DIR)
  set(found ${IST_PROXIMITY_${name}_INCLUDE_DIR})
  set(libraries "")
  foreach(library IN LISTS ARGN)
    find_library(IST_PROXIMITY_${library}_LIBRARY ${library})
    mark_as_advanced(IST_PROXIMITY_${library}_LIBRARY)
    if(NOT IST_PROXIMITY_${library}_LIBRARY)
      set(found "")
    endif()
    list(APPEND libraries ${IST_PROXIMITY_${library}_LIBRARY})
  endforeach()
  if(NOT found)
    message(STATUS "ist_proximity: benchmark without ${name}")
    return()
  endif()
  string(TOUPPER IST_BENCHMARK_${name} definition)
  target_sources(benchmark_peers PRIVATE benchmark/peers/${name}.cpp)
  # Warnings in its templates are not ours.
  set_source_files_properties(benchmark/peers/${name}.cpp PROPERTIES COMPILE_OPTIONS -w)
  target_compile_definitions(benchmark_peers PRIVATE ${definition})
  target_link_libraries(benchmark_peers PRIVATE ${libraries})
endfunction()

ist_proximity_peer(nanoflann nanoflann.hpp)
ist_proximity_peer(embree embree3/rtcore.h embree3)
ist_proximity_peer(fcl fcl/fcl.h fcl ccd octomap octomath)

# The cost of a camera, beside some of them. The robot's own points are dropped with CGAL's hulls.
target_sources(benchmark_camera PRIVATE
  benchmark/peers/flat.cpp
  benchmark/peers/image_pyramid.cpp
  benchmark/peers/kinect.cpp
  benchmark/peers/scene.cpp
  benchmark/peers/synthetic.cpp)
find_path(IST_PROXIMITY_cgal_INCLUDE_DIR CGAL/AABB_tree.h)
find_library(IST_PROXIMITY_gmp_LIBRARY gmp)
mark_as_advanced(IST_PROXIMITY_cgal_INCLUDE_DIR IST_PROXIMITY_gmp_LIBRARY)
if(IST_PROXIMITY_cgal_INCLUDE_DIR AND IST_PROXIMITY_gmp_LIBRARY)
  target_sources(benchmark_camera PRIVATE benchmark/peers/body_filter.cpp)
  set_source_files_properties(benchmark/peers/body_filter.cpp PROPERTIES COMPILE_OPTIONS -w)
  target_compile_definitions(benchmark_camera PRIVATE IST_BENCHMARK_CGAL)
  target_link_libraries(benchmark_camera PRIVATE ${IST_PROXIMITY_gmp_LIBRARY})
endif()
if(IST_PROXIMITY_embree_INCLUDE_DIR AND IST_PROXIMITY_embree3_LIBRARY)
  target_sources(benchmark_camera PRIVATE benchmark/peers/embree.cpp)
  target_compile_definitions(benchmark_camera PRIVATE IST_BENCHMARK_EMBREE)
  target_link_libraries(benchmark_camera PRIVATE ${IST_PROXIMITY_embree3_LIBRARY})
endif()
if(IST_PROXIMITY_nanoflann_INCLUDE_DIR)
  target_sources(benchmark_camera PRIVATE benchmark/peers/nanoflann.cpp)
  target_compile_definitions(benchmark_camera PRIVATE IST_BENCHMARK_NANOFLANN)
endif()

# The node's parts, with ROS; latency needs a roscore while it runs.
if(catkin_FOUND)
  file(GLOB ros_benchmark_sources CONFIGURE_DEPENDS benchmark/ros/*.cpp)
  foreach(source IN LISTS ros_benchmark_sources)
    get_filename_component(name ${source} NAME_WE)
    file(GLOB parts CONFIGURE_DEPENDS benchmark/ros/${name}/*.cpp)
    add_executable(benchmark_${name} EXCLUDE_FROM_ALL ${source} ${parts})
    target_include_directories(benchmark_${name} PRIVATE benchmark)
    target_include_directories(benchmark_${name} SYSTEM PRIVATE ${catkin_INCLUDE_DIRS})
    target_link_libraries(benchmark_${name} PRIVATE test_helpers ist_proximity_ros)
    target_compile_definitions(benchmark_${name} PRIVATE
      IST_PROXIMITY_NODE="$<TARGET_FILE:proximity_node>")
    add_dependencies(benchmark_${name} proximity_node)
    set_target_properties(benchmark_${name} PROPERTIES
      OUTPUT_NAME ${name} RUNTIME_OUTPUT_DIRECTORY ${CMAKE_CURRENT_BINARY_DIR}/benchmark)
    add_dependencies(benchmarks benchmark_${name})
  endforeach()
  target_sources(benchmark_reaction PRIVATE benchmark/ros/latency/traffic.cpp)
  target_link_libraries(benchmark_reaction PRIVATE ist_proximity_simulator)
  target_sources(benchmark_cycle PRIVATE
    benchmark/peers/kinect.cpp
    benchmark/peers/scene.cpp
    benchmark/peers/synthetic.cpp)
endif()
