# The core library, its tools and its installation: no ROS.

# A folder's sources, and those of its rooms. Relative paths: a workspace may itself be called src/ros.
file(GLOB core_sources CONFIGURE_DEPENDS RELATIVE ${CMAKE_CURRENT_SOURCE_DIR}
  src/*/*.cpp src/*/*/*.cpp)
list(FILTER core_sources EXCLUDE REGEX "^src/(nodes|python|ros|tools)/")

# Packing is most of what a fuzzed query does. It takes a hundred times as long where every comparison
# in Eigen is traced and none of its functions is inlined.
if(IST_PROXIMITY_FUZZ)
  set(packing_sources ${core_sources})
  list(FILTER packing_sources INCLUDE REGEX "^src/packing/")
  list(FILTER packing_sources EXCLUDE REGEX "_file.cpp$")
  set_source_files_properties(${packing_sources} PROPERTIES
    COMPILE_OPTIONS "-fno-sanitize-coverage=trace-cmp;-fno-sanitize=alignment,pointer-overflow"
    COMPILE_DEFINITIONS "EIGEN_NO_DEBUG;EIGEN_STRONG_INLINE=inline __attribute__((always_inline))")
endif()

ist_proximity_units(core_units ${core_sources})
add_library(ist_proximity_core ${core_units})
add_library(ist_proximity::ist_proximity_core ALIAS ist_proximity_core)
target_compile_features(ist_proximity_core PUBLIC cxx_std_17)
target_include_directories(ist_proximity_core
  PUBLIC
    $<BUILD_INTERFACE:${CMAKE_CURRENT_SOURCE_DIR}/include>
    $<INSTALL_INTERFACE:${CMAKE_INSTALL_INCLUDEDIR}>
  PRIVATE
    src)
target_link_libraries(ist_proximity_core
  PUBLIC Eigen3::Eigen Threads::Threads
  PRIVATE
    ist_proximity::assimp
    ist_proximity::console_bridge
    ist_proximity::hwy
    ist_proximity::tinyxml2
    ist_proximity::urdfdom
    ist_proximity::urdfdom_headers
    ist_proximity::xxhash)

# Each file in src/tools is a program of its own; the folder of its name holds the rest of it.
find_path(IST_PROXIMITY_CLI11_INCLUDE_DIR CLI/CLI.hpp)
mark_as_advanced(IST_PROXIMITY_CLI11_INCLUDE_DIR)
find_package(PNG QUIET)
set(tools "")
if(IST_PROXIMITY_CLI11_INCLUDE_DIR AND PNG_FOUND)
  file(GLOB tool_sources CONFIGURE_DEPENDS src/tools/*.cpp)
  foreach(source IN LISTS tool_sources)
    get_filename_component(tool ${source} NAME_WE)
    file(GLOB parts CONFIGURE_DEPENDS src/tools/${tool}/*.cpp)
    add_executable(${tool} ${source} ${parts})
    target_include_directories(${tool} PRIVATE src src/tools)
    target_include_directories(${tool} SYSTEM PRIVATE ${IST_PROXIMITY_CLI11_INCLUDE_DIR})
    target_link_libraries(${tool} PRIVATE ist_proximity_core ist_proximity::tinyxml2
      ist_proximity::urdfdom ist_proximity::urdfdom_headers PNG::PNG)
    list(APPEND tools ${tool})
  endforeach()
else()
  message(STATUS "ist_proximity: no pack_robot, CLI11 or libpng is missing "
    "(apt install libcli11-dev libpng-dev)")
endif()

# Within catkin the programs go where rosrun looks for them.
if(catkin_FOUND)
  set(IST_PROXIMITY_BINDIR ${CATKIN_PACKAGE_BIN_DESTINATION})
  set(IST_PROXIMITY_LIBDIR ${CATKIN_PACKAGE_LIB_DESTINATION})
else()
  set(IST_PROXIMITY_BINDIR ${CMAKE_INSTALL_BINDIR})
  set(IST_PROXIMITY_LIBDIR ${CMAKE_INSTALL_LIBDIR})
endif()
file(RELATIVE_PATH bin_to_lib "/${IST_PROXIMITY_BINDIR}" "/${IST_PROXIMITY_LIBDIR}")
set_target_properties(ist_proximity_core PROPERTIES INSTALL_RPATH "$ORIGIN")
if(tools)
  set_target_properties(${tools} PROPERTIES INSTALL_RPATH "$ORIGIN/${bin_to_lib}")
  install(TARGETS ${tools} RUNTIME DESTINATION ${IST_PROXIMITY_BINDIR})
endif()

install(TARGETS ist_proximity_core EXPORT ist_proximity_core-targets
  ARCHIVE DESTINATION ${IST_PROXIMITY_LIBDIR}
  LIBRARY DESTINATION ${IST_PROXIMITY_LIBDIR}
  RUNTIME DESTINATION ${IST_PROXIMITY_BINDIR})
#catkin_lint: ignore_once wrong_install_destination
install(DIRECTORY include/ist_proximity/ DESTINATION ${CMAKE_INSTALL_INCLUDEDIR}/ist_proximity
  FILES_MATCHING PATTERN "*.h"
  PATTERN ros EXCLUDE)

# find_package(ist_proximity_core) for programs that know nothing of ROS.
include(CMakePackageConfigHelpers)
set(core_config_dir ${IST_PROXIMITY_LIBDIR}/cmake/ist_proximity_core)
configure_package_config_file(cmake/ist_proximity_core-config.cmake.in
  ${CMAKE_CURRENT_BINARY_DIR}/ist_proximity_core-config.cmake
  INSTALL_DESTINATION ${core_config_dir})
write_basic_package_version_file(
  ${CMAKE_CURRENT_BINARY_DIR}/ist_proximity_core-config-version.cmake
  COMPATIBILITY SameMinorVersion)
#catkin_lint: ignore_once missing_file wrong_install_destination
install(
  FILES
    ${CMAKE_CURRENT_BINARY_DIR}/ist_proximity_core-config.cmake
    ${CMAKE_CURRENT_BINARY_DIR}/ist_proximity_core-config-version.cmake
    cmake/dependencies.cmake
  DESTINATION ${core_config_dir})
install(EXPORT ist_proximity_core-targets
  NAMESPACE ist_proximity:: DESTINATION ${core_config_dir})
