# Programs that measure: one per benchmark/*.cpp, built on demand (target `benchmarks`), not installed.

file(GLOB benchmark_sources CONFIGURE_DEPENDS benchmark/*.cpp)
add_custom_target(benchmarks)
foreach(source IN LISTS benchmark_sources)
  get_filename_component(name ${source} NAME_WE)
  add_executable(benchmark_${name} EXCLUDE_FROM_ALL ${source})
  # They read the test data with the tests' helpers.
  target_include_directories(benchmark_${name} PRIVATE benchmark src test)
  target_link_libraries(benchmark_${name} PRIVATE ist_proximity_core ist_proximity::hwy)
  target_compile_definitions(benchmark_${name} PRIVATE
    IST_PROXIMITY_SOURCE_DIR="${CMAKE_CURRENT_SOURCE_DIR}")
  set_target_properties(benchmark_${name} PROPERTIES
    OUTPUT_NAME ${name} RUNTIME_OUTPUT_DIRECTORY ${CMAKE_CURRENT_BINARY_DIR}/benchmark)
  add_dependencies(benchmarks benchmark_${name})
endforeach()

# What the maps are measured beside, where it is installed.
find_path(FCL_INCLUDE_DIR fcl/fcl.h)
find_library(FCL_LIBRARY fcl)
find_library(CCD_LIBRARY ccd)
mark_as_advanced(FCL_INCLUDE_DIR FCL_LIBRARY CCD_LIBRARY)
if(FCL_INCLUDE_DIR AND FCL_LIBRARY AND CCD_LIBRARY AND octomap_FOUND)
  target_compile_definitions(benchmark_octomap PRIVATE IST_PROXIMITY_HAS_FCL)
  target_include_directories(benchmark_octomap SYSTEM PRIVATE
    ${FCL_INCLUDE_DIR} ${OCTOMAP_INCLUDE_DIR})
  target_link_libraries(benchmark_octomap PRIVATE
    ${FCL_LIBRARY} ${CCD_LIBRARY} ${OCTOMAP_LIBRARY} ${OCTOMATH_LIBRARY})
else()
  message(STATUS "ist_proximity: benchmark/octomap without FCL (apt install libfcl-dev)")
endif()

# A yardstick, where it is installed (libembree-dev).
find_package(embree 3 QUIET)
if(TARGET embree)
  target_link_libraries(benchmark_packing PRIVATE embree)
  target_compile_definitions(benchmark_packing PRIVATE IST_PROXIMITY_EMBREE)
endif()
