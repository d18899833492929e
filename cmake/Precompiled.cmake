# Precompiled headers: a set for the simulator's modules of each level of optimisation, one for all others, one for the tests
# of each, and one for optimised tests, so that the standard library, Eigen and GoogleTest are not parsed anew for each file.
# All presets but debug use them. A compiler cache does the same work better and cannot use them. The debug preset, and with
# it scripts/lint, goes without, so that each file shows that it includes what it needs.
option(SMARTSURF_PCH "Use precompiled headers (not together with a compiler launcher such as ccache)" OFF)
if(CMAKE_CXX_COMPILER_LAUNCHER)
  set(SMARTSURF_PCH OFF)
endif()

set(precompiled_standard <algorithm> <array> <atomic> <charconv> <chrono> <cmath> <cstddef> <cstdint> <cstdio> <cstdlib>
  <cstring> <filesystem> <fstream> <functional> <limits> <map> <memory> <optional> <random> <set> <span> <sstream> <string>
  <string_view> <thread> <utility> <variant> <vector>)

# add_precompiled(<name> [PROGRAM] HEADERS … [LIBS …] [OPTIONS …]): headers for other targets to reuse. A compiler accepts
# them only with equal flags and macros: modules are compiled with -fPIC, tests (PROGRAM) with -fPIE.
function(add_precompiled name)
  cmake_parse_arguments(P "PROGRAM" "" "HEADERS;LIBS;OPTIONS" ${ARGN})
  file(CONFIGURE OUTPUT ${PROJECT_BINARY_DIR}/precompiled/${name}.cpp CONTENT "")
  add_library(${name} OBJECT EXCLUDE_FROM_ALL ${PROJECT_BINARY_DIR}/precompiled/${name}.cpp)
  target_link_libraries(${name} PRIVATE project_options ${P_LIBS})
  target_compile_options(${name} PRIVATE ${P_OPTIONS})
  if(P_PROGRAM)
    set_target_properties(${name} PROPERTIES POSITION_INDEPENDENT_CODE OFF)
    target_compile_options(${name} PRIVATE -fPIE)
  endif()
  list(TRANSFORM P_HEADERS REPLACE "(.+)" "$<$<COMPILE_LANGUAGE:CXX>:\\1>")
  target_precompile_headers(${name} PRIVATE ${P_HEADERS})
endfunction()

# precompile(<target> <name>): the target reuses that set.
function(precompile target name)
  if(SMARTSURF_PCH)
    target_precompile_headers(${target} REUSE_FROM ${name})
  endif()
endfunction()

if(SMARTSURF_PCH)
  # GCC 12 reports false overruns of moved std::strings when their header is precompiled.
  target_compile_options(project_options INTERFACE -Wno-array-bounds)
  add_precompiled(precompiled_standard HEADERS ${precompiled_standard})
  add_precompiled(precompiled_smartsurf HEADERS ${precompiled_standard} <Eigen/Geometry> LIBS Eigen3::Eigen)
  if(SMARTSURF_OPTIMISED_OPTIONS)
    add_precompiled(precompiled_smartsurf_optimised HEADERS ${precompiled_standard} <Eigen/Geometry> LIBS Eigen3::Eigen
      OPTIONS ${SMARTSURF_OPTIMISED_OPTIONS})
  endif()
  if(GTest_FOUND)
    add_precompiled(precompiled_apron_test PROGRAM HEADERS ${precompiled_standard} <gtest/gtest.h> LIBS GTest::gtest
      OPTIONS ${SMARTSURF_TEST_OPTIONS})
    add_precompiled(precompiled_smartsurf_test PROGRAM HEADERS ${precompiled_standard} <Eigen/Geometry> <gtest/gtest.h>
      LIBS Eigen3::Eigen GTest::gtest OPTIONS ${SMARTSURF_TEST_OPTIONS})
    foreach(name precompiled_apron_test precompiled_smartsurf_test)
      set_target_properties(${name} PROPERTIES IS_UNIT_TEST ON)
      use_test_compiler(${name})
    endforeach()
    add_precompiled(precompiled_optimised_test PROGRAM HEADERS ${precompiled_standard} <gtest/gtest.h> LIBS GTest::gtest
      OPTIONS ${optimised_test_options})
  endif()
endif()
