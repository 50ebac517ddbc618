# A simulated arm, its cameras and obstacles, and the example controller: for tests, the benchmark
# and the demonstration. Nothing that is installed for controllers depends on them.

add_library(ist_proximity_dodge STATIC EXCLUDE_FROM_ALL examples/dodge_controller.cpp)
target_include_directories(ist_proximity_dodge PUBLIC examples)
target_link_libraries(ist_proximity_dodge PUBLIC ist_proximity_core)

file(GLOB simulator_sources CONFIGURE_DEPENDS simulator/*.cpp)
add_library(ist_proximity_simulator STATIC EXCLUDE_FROM_ALL ${simulator_sources})
target_include_directories(ist_proximity_simulator PUBLIC simulator PRIVATE src)
target_link_libraries(ist_proximity_simulator PUBLIC ist_proximity_core ist_proximity_dodge)
