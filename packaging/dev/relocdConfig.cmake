# relocd::messages: the types of relocd's messages, `#include <relocd/localization_t.hpp>`, and LCM, which carries them.
find_path(relocd_INCLUDE_DIR relocd/localization_t.hpp PATHS "${CMAKE_CURRENT_LIST_DIR}/../../../include" NO_DEFAULT_PATH)
find_path(relocd_LCM_INCLUDE_DIR lcm/lcm-cpp.hpp)
find_library(relocd_LCM_LIBRARY lcm)
mark_as_advanced(relocd_INCLUDE_DIR relocd_LCM_INCLUDE_DIR relocd_LCM_LIBRARY)

include(FindPackageHandleStandardArgs)
find_package_handle_standard_args(relocd
  REQUIRED_VARS relocd_INCLUDE_DIR relocd_LCM_INCLUDE_DIR relocd_LCM_LIBRARY
  REASON_FAILURE_MESSAGE "LCM is in Debian's package liblcm-dev"
  VERSION_VAR relocd_VERSION)

if(relocd_FOUND AND NOT TARGET relocd::messages)
  add_library(relocd::messages INTERFACE IMPORTED)
  target_include_directories(relocd::messages INTERFACE "${relocd_INCLUDE_DIR}" "${relocd_LCM_INCLUDE_DIR}")
  target_link_libraries(relocd::messages INTERFACE "${relocd_LCM_LIBRARY}")
endif()
