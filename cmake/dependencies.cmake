# Third-party libraries that the core uses inside, as imported targets.
#
# Also installed: the package configuration of a static core library includes it.

# Highway. Debian has it from 12 on, Ubuntu from 24.04; before that it is built from source.
if(NOT TARGET ist_proximity::hwy)
  add_library(ist_proximity::hwy INTERFACE IMPORTED)
  find_package(hwy 1.0 CONFIG QUIET)
  if(TARGET hwy::hwy)
    set_property(TARGET ist_proximity::hwy PROPERTY INTERFACE_LINK_LIBRARIES hwy::hwy)
  else()
    find_package(PkgConfig QUIET)
    if(PKG_CONFIG_FOUND)
      pkg_check_modules(ist_proximity_hwy QUIET IMPORTED_TARGET libhwy>=1.0)
    endif()
    if(NOT ist_proximity_hwy_FOUND)
      message(FATAL_ERROR
        "ist_proximity needs Highway (https://github.com/google/highway), version 1.0 or later.\n"
        "Debian 12, Ubuntu 24.04 and later: apt install libhwy-dev\n"
        "Ubuntu 20.04 and 22.04 (no package, or too old a one): build and install it from source, "
        "with -DBUILD_TESTING=OFF -DBUILD_SHARED_LIBS=ON -DHWY_ENABLE_EXAMPLES=OFF. Any prefix will "
        "do, when CMAKE_PREFIX_PATH names it.")
    endif()
    set_property(
      TARGET ist_proximity::hwy PROPERTY INTERFACE_LINK_LIBRARIES PkgConfig::ist_proximity_hwy)
  endif()
endif()

# The packages below come with or without a CMake configuration, and with different target names,
# depending on their version; header and library have been the same everywhere.
function(ist_proximity_find_library name)
  cmake_parse_arguments(arg "" "HEADER;LIBRARY;PACKAGE" "PATH_SUFFIXES" ${ARGN})
  if(TARGET ist_proximity::${name})
    return()
  endif()
  find_path(IST_PROXIMITY_${name}_INCLUDE_DIR ${arg_HEADER} PATH_SUFFIXES ${arg_PATH_SUFFIXES})
  find_library(IST_PROXIMITY_${name}_LIBRARY ${arg_LIBRARY})
  mark_as_advanced(IST_PROXIMITY_${name}_INCLUDE_DIR IST_PROXIMITY_${name}_LIBRARY)
  if(NOT IST_PROXIMITY_${name}_INCLUDE_DIR OR NOT IST_PROXIMITY_${name}_LIBRARY)
    message(FATAL_ERROR
      "ist_proximity needs ${name}: <${arg_HEADER}> and lib${arg_LIBRARY}. "
      "Debian and Ubuntu: apt install ${arg_PACKAGE}")
  endif()
  add_library(ist_proximity::${name} UNKNOWN IMPORTED)
  set_target_properties(ist_proximity::${name} PROPERTIES
    IMPORTED_LOCATION "${IST_PROXIMITY_${name}_LIBRARY}"
    INTERFACE_INCLUDE_DIRECTORIES "${IST_PROXIMITY_${name}_INCLUDE_DIR}")
endfunction()

ist_proximity_find_library(assimp
  HEADER assimp/Importer.hpp LIBRARY assimp PACKAGE libassimp-dev)
ist_proximity_find_library(xxhash
  HEADER xxhash.h LIBRARY xxhash PACKAGE libxxhash-dev)
ist_proximity_find_library(console_bridge
  HEADER console_bridge/console.h LIBRARY console_bridge PACKAGE libconsole-bridge-dev)
ist_proximity_find_library(tinyxml2
  HEADER tinyxml2.h LIBRARY tinyxml2 PACKAGE libtinyxml2-dev)
ist_proximity_find_library(urdfdom_headers
  HEADER urdf_model/model.h LIBRARY urdfdom_model PACKAGE liburdfdom-headers-dev
  PATH_SUFFIXES urdfdom_headers)
ist_proximity_find_library(urdfdom
  HEADER urdf_parser/urdf_parser.h LIBRARY urdfdom_model PACKAGE liburdfdom-dev
  PATH_SUFFIXES urdfdom)
