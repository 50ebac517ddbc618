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

# A yardstick, where it is installed (libembree-dev).
find_package(embree 3 QUIET)
if(TARGET embree)
  target_link_libraries(benchmark_packing PRIVATE embree)
  target_compile_definitions(benchmark_packing PRIVATE IST_PROXIMITY_EMBREE)
endif()
