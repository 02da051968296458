# Generates C++ from .lcm files. Debian's liblcm-dev 1.3.1 has no CMake package that would.

find_program(LCM_GEN lcm-gen REQUIRED)

# relocd_add_lcm_types(<target> <file.lcm>...): a header-only target with the generated C++ types.
function(relocd_add_lcm_types target)
  set(out ${CMAKE_CURRENT_BINARY_DIR}/generated)
  foreach(lcm_file IN LISTS ARGN)
    get_filename_component(name ${lcm_file} NAME_WE)
    add_custom_command(
      OUTPUT ${out}/relocd/${name}.hpp
      COMMAND ${LCM_GEN} --cpp --cpp-std c++11 --cpp-hpath ${out} ${CMAKE_CURRENT_SOURCE_DIR}/${lcm_file}
      DEPENDS ${lcm_file}
      VERBATIM)
    list(APPEND headers ${out}/relocd/${name}.hpp)
  endforeach()
  install(FILES ${headers} DESTINATION include/relocd COMPONENT relocd-dev)
  install(FILES ${ARGN} DESTINATION share/relocd/lcmtypes COMPONENT relocd-dev)
  add_custom_target(${target}_generate DEPENDS ${headers})
  add_library(${target} INTERFACE)
  add_dependencies(${target} ${target}_generate)
  target_include_directories(${target} SYSTEM INTERFACE ${out})  # generated code is not ours to warn about
  target_link_libraries(${target} INTERFACE Lcm::lcm)
endfunction()
