# The one place where targets get their language level, warnings and sanitizers.

include(GoogleTest)

set(RELOCD_SANITIZERS "" CACHE STRING "Sanitizers for every target of ours, as in address,undefined")

add_library(relocd_build_flags INTERFACE)
target_compile_features(relocd_build_flags INTERFACE cxx_std_20)
target_compile_options(relocd_build_flags INTERFACE
  -Wall -Wextra -Wpedantic -Wconversion -Wshadow -Wnon-virtual-dtor -Wold-style-cast -Wimplicit-fallthrough
  -ffp-contract=off)  # the exact replay gives the same bits on CPUs with and without FMA
target_link_options(relocd_build_flags INTERFACE -Wl,--as-needed)  # camerad and the like load neither OpenCV nor Ceres
if(RELOCD_SANITIZERS)
  target_compile_options(relocd_build_flags INTERFACE -fsanitize=${RELOCD_SANITIZERS} -fno-omit-frame-pointer)
  target_link_options(relocd_build_flags INTERFACE -fsanitize=${RELOCD_SANITIZERS})
  # Under the address sanitizer Eigen allocates in another way than in Debian's Ceres, which then frees what it must not.
  target_compile_definitions(relocd_build_flags INTERFACE EIGEN_MALLOC_ALREADY_ALIGNED=1)
  # A function's clone for this CPU is chosen while the program is loaded, before the thread sanitizer is up: its checks would crash there.
  target_compile_options(relocd_build_flags INTERFACE "-Dtarget_clones(...)=")
endif()

# relocd_add_library(<module> SOURCES ... [DEPENDS ...] [PRIVATE_DEPENDS ...])
#
# Adds relocd_<module>, known to the others as relocd::<module>. Without a .cc file it is header-only.
function(relocd_add_library module)
  cmake_parse_arguments(PARSE_ARGV 1 arg "" "" "SOURCES;DEPENDS;PRIVATE_DEPENDS")
  set(target relocd_${module})
  set(compiled ${arg_SOURCES})
  list(FILTER compiled INCLUDE REGEX "\\.cc$")
  if(compiled)
    add_library(${target} STATIC ${arg_SOURCES})
    target_include_directories(${target} PUBLIC ${PROJECT_SOURCE_DIR}/lib)
    target_link_libraries(${target} PUBLIC ${arg_DEPENDS} PRIVATE ${arg_PRIVATE_DEPENDS} relocd_build_flags)
    target_compile_features(${target} PUBLIC cxx_std_20)
  else()
    add_library(${target} INTERFACE ${arg_SOURCES})
    target_include_directories(${target} INTERFACE ${PROJECT_SOURCE_DIR}/lib)
    target_link_libraries(${target} INTERFACE ${arg_DEPENDS} ${arg_PRIVATE_DEPENDS})
  endif()
  add_library(relocd::${module} ALIAS ${target})
endfunction()

# relocd_add_daemon(<name> SOURCES <node>.h <node>.cc ... [DEPENDS ...])
#
# Adds <name>_node, a library that tests and the replay link too, and the executable <name> from main.cc.
function(relocd_add_daemon name)
  cmake_parse_arguments(PARSE_ARGV 1 arg "" "" "SOURCES;DEPENDS")
  add_library(${name}_node STATIC ${arg_SOURCES})
  target_include_directories(${name}_node PUBLIC ${PROJECT_SOURCE_DIR}/daemons)
  target_link_libraries(${name}_node PUBLIC ${arg_DEPENDS} PRIVATE relocd_build_flags)
  add_executable(${name} main.cc)
  target_link_libraries(${name} PRIVATE ${name}_node relocd_daemon relocd_build_flags)
  install(TARGETS ${name} COMPONENT relocd)
endfunction()

# relocd_add_tool(<verb> [DEPENDS ...]): tools/reloc_<verb>.cc as the executable reloc-<verb>.
function(relocd_add_tool verb)
  cmake_parse_arguments(PARSE_ARGV 1 arg "" "" "SOURCES;DEPENDS")
  string(REPLACE "-" "_" file ${verb})
  add_executable(reloc-${verb} reloc_${file}.cc ${arg_SOURCES})
  target_include_directories(reloc-${verb} PRIVATE ${PROJECT_SOURCE_DIR}/tools)
  target_link_libraries(reloc-${verb} PRIVATE ${arg_DEPENDS} CLI11::CLI11 relocd_build_flags)
  install(TARGETS reloc-${verb} COMPONENT relocd-tools)
  set_property(GLOBAL APPEND PROPERTY RELOCD_TOOLS reloc-${verb})  # for the manual pages
endfunction()

# relocd_add_tests(<folder> SOURCES a_test.cc ... [DEPENDS ...]): one test binary a folder of tests/.
function(relocd_add_tests folder)
  cmake_parse_arguments(PARSE_ARGV 1 arg "" "" "SOURCES;DEPENDS")
  add_executable(${folder}_tests ${arg_SOURCES})
  target_include_directories(${folder}_tests PRIVATE ${PROJECT_SOURCE_DIR}/tests)
  target_compile_definitions(${folder}_tests PRIVATE RELOCD_SOURCE_DIR="${PROJECT_SOURCE_DIR}")
  target_link_libraries(${folder}_tests PRIVATE ${arg_DEPENDS} GTest::gmock GTest::gtest_main relocd_build_flags)
  gtest_discover_tests(${folder}_tests TEST_PREFIX "${folder}/" DISCOVERY_TIMEOUT 60 NO_PRETTY_VALUES)
endfunction()
