# The Python module: `import ist_proximity`. Within catkin it shares the package of that name with the
# generated messages.

option(IST_PROXIMITY_WITH_PYTHON "Build the Python module, if pybind11 is found" ON)
if(NOT IST_PROXIMITY_WITH_PYTHON OR IST_PROXIMITY_SANITIZE)
  return()
endif()
if(PYTHON_EXECUTABLE AND NOT Python_EXECUTABLE)
  set(Python_EXECUTABLE ${PYTHON_EXECUTABLE})
endif()
find_package(Python COMPONENTS Interpreter Development.Module QUIET)
find_package(pybind11 2.6 CONFIG QUIET)
if(NOT pybind11_FOUND OR NOT Python_Interpreter_FOUND)
  message(STATUS "ist_proximity: no Python module, pybind11 is missing (apt install pybind11-dev)")
  return()
endif()

if(catkin_FOUND)
  set(python_output ${CATKIN_DEVEL_PREFIX}/${CATKIN_GLOBAL_PYTHON_DESTINATION}/ist_proximity)
  set(python_destination ${CATKIN_GLOBAL_PYTHON_DESTINATION}/ist_proximity)
else()
  set(python_output ${CMAKE_CURRENT_BINARY_DIR}/python/ist_proximity)
  set(python_destination lib/python3/dist-packages/ist_proximity)
endif()
file(GLOB_RECURSE python_modules CONFIGURE_DEPENDS
  RELATIVE ${CMAKE_CURRENT_SOURCE_DIR}/python/ist_proximity python/ist_proximity/*.py)
foreach(module IN LISTS python_modules)
  configure_file(python/ist_proximity/${module} ${python_output}/${module} COPYONLY)
endforeach()

file(GLOB python_sources CONFIGURE_DEPENDS RELATIVE ${CMAKE_CURRENT_SOURCE_DIR} src/python/*.cpp)
ist_proximity_units(python_units ${python_sources})
add_library(ist_proximity_python MODULE ${python_units})
pybind11_extension(ist_proximity_python)
target_include_directories(ist_proximity_python PRIVATE src)
target_link_libraries(ist_proximity_python PRIVATE ist_proximity_core pybind11::module)
set_target_properties(ist_proximity_python PROPERTIES
  OUTPUT_NAME _core
  CXX_VISIBILITY_PRESET hidden
  LIBRARY_OUTPUT_DIRECTORY ${python_output}
  INSTALL_RPATH "$ORIGIN/../../..;$ORIGIN/../../../${CMAKE_LIBRARY_ARCHITECTURE}")
install(TARGETS ist_proximity_python LIBRARY DESTINATION ${python_destination})
if(catkin_FOUND)
  # The generated messages' rule installs the modules, which are in one folder with them.
  catkin_install_python(PROGRAMS src/tools/proximity_report
    DESTINATION ${CATKIN_PACKAGE_BIN_DESTINATION})
else()
  install(DIRECTORY python/ist_proximity/ DESTINATION ${python_destination}
    FILES_MATCHING PATTERN "*.py")
  install(PROGRAMS src/tools/proximity_report DESTINATION ${CMAKE_INSTALL_BINDIR})
endif()

# Its tests, with pytest.
execute_process(COMMAND ${Python_EXECUTABLE} -c "import numpy, pytest"
  RESULT_VARIABLE pytest_missing OUTPUT_QUIET ERROR_QUIET)
if(pytest_missing)
  message(STATUS "ist_proximity: no tests of the Python module "
    "(apt install python3-numpy python3-pytest)")
elseif(CATKIN_ENABLE_TESTING OR BUILD_TESTING)
  get_filename_component(python_path ${python_output} DIRECTORY)
  add_test(NAME python_module COMMAND ${Python_EXECUTABLE} -m pytest -q -p no:cacheprovider
    --junitxml=${CMAKE_BINARY_DIR}/test_results/${PROJECT_NAME}/gtest-python_module.xml
    ${CMAKE_CURRENT_SOURCE_DIR}/test/python)
  set_tests_properties(python_module PROPERTIES LABELS core TIMEOUT 600 COST 28
    ENVIRONMENT "PYTHONPATH=${python_path};PYTHONDONTWRITEBYTECODE=1")
endif()
