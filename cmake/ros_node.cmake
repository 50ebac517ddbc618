# The ROS library, node and nodelet, and the files to which a robot's launch file refers.

# What the node can be built without: each is a folder of src/ros, a target, and a function that makes
# it. Those that are named later may use what those before them have made.
set(add_ons unknown_space trajectory link_pairs)
set(IST_PROXIMITY_ADD_ONS "${add_ons}" CACHE STRING "Add-ons of the node: a list of ${add_ons}")
foreach(add_on IN LISTS IST_PROXIMITY_ADD_ONS)
  if(NOT add_on IN_LIST add_ons)
    message(FATAL_ERROR "IST_PROXIMITY_ADD_ONS names '${add_on}', which is none of ${add_ons}")
  endif()
endforeach()

file(GLOB ros_sources CONFIGURE_DEPENDS RELATIVE ${CMAKE_CURRENT_SOURCE_DIR}
  src/ros/*.cpp src/ros/*/*.cpp)
set(built_add_ons "")
set(add_on_objects "")
set(add_on_targets "")
foreach(add_on IN LISTS add_ons)
  set(sources ${ros_sources})
  list(FILTER sources INCLUDE REGEX "^src/ros/${add_on}/")
  list(REMOVE_ITEM ros_sources ${sources})
  if(add_on IN_LIST IST_PROXIMITY_ADD_ONS)
    ist_proximity_units(units ${sources})
    add_library(ist_proximity_${add_on} OBJECT ${units})
    list(APPEND built_add_ons ${add_on})
    list(APPEND add_on_targets ist_proximity_${add_on})
    list(APPEND add_on_objects $<TARGET_OBJECTS:ist_proximity_${add_on}>)
  endif()
endforeach()
ist_proximity_units(ros_units ${ros_sources})
add_library(ist_proximity_ros_objects OBJECT ${ros_units})

# ist_proximity_add_on_table(RESULT ADD_ON...): a source that names the add-ons that are built, and
# makes them.
function(ist_proximity_add_on_table result)
  set(declarations "")
  set(names "")
  set(calls "")
  foreach(add_on IN LISTS ARGN)
    string(APPEND declarations "std::unique_ptr<AddOn> make_${add_on}(const AddOnContext&);\n")
    string(APPEND names "\"${add_on}\", ")
    string(APPEND calls "  add(make_${add_on}(context));\n")
  endforeach()
  string(MAKE_C_IDENTIFIER "add_ons_${ARGN}" file)
  configure_file(${CMAKE_CURRENT_SOURCE_DIR}/cmake/add_ons.cpp.in
    ${CMAKE_CURRENT_BINARY_DIR}/units/${file}.cpp @ONLY)
  set(${result} ${CMAKE_CURRENT_BINARY_DIR}/units/${file}.cpp PARENT_SCOPE)
endfunction()

ist_proximity_add_on_table(table ${built_add_ons})
add_library(ist_proximity_ros ${table} $<TARGET_OBJECTS:ist_proximity_ros_objects> ${add_on_objects})
target_link_libraries(ist_proximity_ros PUBLIC ist_proximity_core ${catkin_LIBRARIES})
foreach(target ist_proximity_ros_objects ${add_on_targets})
  set_target_properties(${target} PROPERTIES POSITION_INDEPENDENT_CODE ON)
  add_dependencies(${target} ${${PROJECT_NAME}_EXPORTED_TARGETS} ${catkin_EXPORTED_TARGETS})
  target_link_libraries(${target} PRIVATE ist_proximity_core)
endforeach()

add_executable(proximity_node src/nodes/proximity_node.cpp)
target_link_libraries(proximity_node PRIVATE ist_proximity_ros)

add_executable(velocity_filter_node src/nodes/velocity_filter_node.cpp)
target_link_libraries(velocity_filter_node PRIVATE ist_proximity_ros)

add_library(ist_proximity_nodelet MODULE
  src/nodes/proximity_nodelet.cpp src/nodes/velocity_filter_nodelet.cpp)
target_link_libraries(ist_proximity_nodelet PRIVATE ist_proximity_ros)

foreach(target ist_proximity_ros ist_proximity_ros_objects ${add_on_targets} proximity_node
    velocity_filter_node ist_proximity_nodelet)
  target_include_directories(${target} PRIVATE src)
  # Warnings in system headers are not ours to mend.
  target_include_directories(${target} SYSTEM PRIVATE ${catkin_INCLUDE_DIRS})
endforeach()

# What a robot runs: without tools, examples, the simulator and the Python module.
add_custom_target(ist_proximity_nodes DEPENDS proximity_node velocity_filter_node ist_proximity_nodelet
  ${${PROJECT_NAME}_EXPORTED_TARGETS})

# The demonstration of a controller: a simulated robot and an example controller.
add_executable(simulator_node simulator/nodes/simulator_node.cpp)
target_link_libraries(simulator_node PRIVATE ist_proximity_simulator ${catkin_LIBRARIES})
add_executable(dodge_node examples/dodge_node.cpp)
target_link_libraries(dodge_node PRIVATE ist_proximity_dodge ${catkin_LIBRARIES})
# The same controller without ROS; examples/CMakeLists.txt builds it against the installed core.
add_executable(direct_controller examples/direct_controller.cpp)
target_link_libraries(direct_controller PRIVATE ist_proximity_dodge)
foreach(target simulator_node dodge_node direct_controller)
  target_include_directories(${target} SYSTEM PRIVATE ${catkin_INCLUDE_DIRS})
  add_dependencies(${target} ${${PROJECT_NAME}_EXPORTED_TARGETS} ${catkin_EXPORTED_TARGETS})
  set_target_properties(${target} PROPERTIES INSTALL_RPATH "$ORIGIN/${bin_to_lib}")
  install(TARGETS ${target} RUNTIME DESTINATION ${CATKIN_PACKAGE_BIN_DESTINATION})
endforeach()

set_target_properties(ist_proximity_ros ist_proximity_nodelet PROPERTIES INSTALL_RPATH "$ORIGIN")
set_target_properties(proximity_node velocity_filter_node PROPERTIES
  INSTALL_RPATH "$ORIGIN/${bin_to_lib}")

install(TARGETS ist_proximity_ros ist_proximity_nodelet
  ARCHIVE DESTINATION ${CATKIN_PACKAGE_LIB_DESTINATION}
  LIBRARY DESTINATION ${CATKIN_PACKAGE_LIB_DESTINATION}
  RUNTIME DESTINATION ${CATKIN_GLOBAL_BIN_DESTINATION})
install(TARGETS proximity_node velocity_filter_node
  RUNTIME DESTINATION ${CATKIN_PACKAGE_BIN_DESTINATION})
install(DIRECTORY include/ist_proximity/ros/
  DESTINATION ${CATKIN_PACKAGE_INCLUDE_DESTINATION}/ros FILES_MATCHING PATTERN "*.h")
install(FILES nodelet_plugins.xml DESTINATION ${CATKIN_PACKAGE_SHARE_DESTINATION})
install(DIRECTORY config demo examples launch DESTINATION ${CATKIN_PACKAGE_SHARE_DESTINATION}
  USE_SOURCE_PERMISSIONS
  PATTERN __pycache__ EXCLUDE)
# Those in the repository are not executable: rosrun would find two programs of a name.
catkin_install_python(PROGRAMS src/nodes/proximity_table src/nodes/proximity_rviz
  src/nodes/planning_scene_bridge
  src/nodes/trajectory_bridge
  DESTINATION ${CATKIN_PACKAGE_BIN_DESTINATION})
install(FILES src/nodes/lasting_subscriber.py src/nodes/scene_objects.py src/nodes/scene_state.py
  DESTINATION ${CATKIN_PACKAGE_BIN_DESTINATION})
