# One static library per module (docs/architecture.md), all compiled with the same options.

add_library(project_options INTERFACE)
# -ffp-contract=off: GCC fuses a*b+c into one FMA wherever the target has it, so the same source would round
# differently from one function, compiler or machine to the next. Determinism is a promise here, so every
# multiply and every add rounds on its own; kernels that want an FMA must write it.
target_compile_options(project_options INTERFACE
  -ffp-contract=off
  -fno-math-errno   # lets loops over sqrt vectorise; nobody reads errno after it, and no result changes
  # Functions call and inline each other directly in position-independent code too: worth a tenth of a small world's step.
  $<$<COMPILE_LANGUAGE:CXX>:-fvisibility=hidden>
  -Wall -Wextra -Wpedantic -Wshadow
  # GCC 12 sees overlaps in std::string's operator+ that are not there (PR 105651).
  $<$<CXX_COMPILER_ID:GNU>:-Wno-restrict>
  $<$<COMPILE_LANGUAGE:CXX>:-Wnon-virtual-dtor -Woverloaded-virtual>
  $<$<BOOL:${SMARTSURF_WERROR}>:-Werror>)
# Addresses of library functions are resolved at the start and then read-only; neither stack nor data can be executed.
if(NOT EMSCRIPTEN)
  target_link_options(project_options INTERFACE -Wl,-z,relro -Wl,-z,now -Wl,-z,noexecstack)
endif()
# What makes an overflow or an overwritten address end the program.
set(hardening_options -U_FORTIFY_SOURCE -D_FORTIFY_SOURCE=2 -fstack-protector-strong)
if(CMAKE_SYSTEM_PROCESSOR MATCHES "x86_64|AMD64")
  list(APPEND hardening_options -fcf-protection=full)
elseif(CMAKE_SYSTEM_PROCESSOR MATCHES "aarch64|arm64")
  list(APPEND hardening_options -mbranch-protection=standard)
endif()
if(SMARTSURF_HARDEN AND NOT SMARTSURF_SANITIZE)
  target_compile_options(project_options INTERFACE ${hardening_options})
endif()
target_include_directories(project_options INTERFACE ${PROJECT_SOURCE_DIR})
target_compile_definitions(project_options INTERFACE SMARTSURF_VERSION="${PROJECT_VERSION}")
# The instruction sets that vector kernels are compiled for. A copy for SSSE3 alone does not pay: such a CPU runs the
# SSE2 or SSE4 one. The preset ci leaves SSE4 out, whose vectors are as wide as those of SSE2, and what this machine cannot
# run. Sanitizer builds compile for one set, AVX2 where this machine has it, because such a file then takes longer than the
# rest of its module.
set(cpu_features "")
if(EXISTS /proc/cpuinfo)
  file(STRINGS /proc/cpuinfo cpu_features REGEX "^flags" LIMIT_COUNT 1)
endif()
if(SMARTSURF_SANITIZE)
  target_compile_definitions(project_options INTERFACE "HWY_DISABLED_TARGETS=(HWY_SSSE3|HWY_SSE4|HWY_AVX3)")
  if(cpu_features MATCHES " avx2 ")
    target_compile_definitions(project_options INTERFACE HWY_BASELINE_TARGETS=HWY_AVX2)
  else()
    target_compile_definitions(project_options INTERFACE HWY_COMPILE_ONLY_STATIC)
  endif()
elseif(CMAKE_SYSTEM_PROCESSOR MATCHES "aarch64|arm64")
  # Vectors are members of structures, which SVE's vectors without a size cannot be: NEON alone.
  target_compile_definitions(project_options INTERFACE
    "HWY_DISABLED_TARGETS=(HWY_SVE|HWY_SVE2|HWY_SVE_256|HWY_SVE2_128)")
elseif(EMSCRIPTEN)
  target_compile_definitions(project_options INTERFACE HWY_COMPILE_ONLY_STATIC)
else()
  set(disabled_targets HWY_SSSE3)
  if(SMARTSURF_FEWER_TARGETS)
    string(APPEND disabled_targets "|HWY_SSE4")
    if(NOT cpu_features MATCHES " avx512dq ")
      string(APPEND disabled_targets "|HWY_AVX3")
    endif()
  endif()
  target_compile_definitions(project_options INTERFACE "HWY_DISABLED_TARGETS=(${disabled_targets})")
endif()
if(SMARTSURF_SANITIZE)
  target_compile_options(project_options INTERFACE -fsanitize=${SMARTSURF_SANITIZE} -fno-omit-frame-pointer
    -fno-sanitize-recover=all
    # The preset ci warns of the modules; it leaves out some unit tests, whose warnings stay on here.
    $<$<NOT:$<BOOL:$<TARGET_PROPERTY:IS_UNIT_TEST>>>:-w>)
  # Checks that AddressSanitizer covers are off, which saves a third of the compile time. Misaligned addresses can only
  # come from another process's bytes. A unit test's own code is not instrumented by UBSan.
  if(SMARTSURF_SANITIZE MATCHES "address.*undefined")
    target_compile_options(project_options INTERFACE
      -fno-sanitize=null,object-size,pointer-overflow,vptr,nonnull-attribute,returns-nonnull-attribute
      $<$<NOT:$<BOOL:$<TARGET_PROPERTY:TAKES_FOREIGN_BYTES>>>:-fno-sanitize=alignment>
      $<$<BOOL:$<TARGET_PROPERTY:IS_UNIT_TEST>>:-fno-sanitize=undefined>)
  endif()
  target_link_options(project_options INTERFACE -fsanitize=${SMARTSURF_SANITIZE})
  if(CMAKE_CXX_COMPILER_ID MATCHES Clang)
    string(REGEX MATCH "address|thread" sanitizer ${SMARTSURF_SANITIZE})
    string(TOUPPER "__sanitize_${sanitizer}__" macro)
    target_compile_definitions(project_options INTERFACE ${macro})  # as GCC does
    find_program(LLD ld.lld PATHS /usr/lib/llvm-16/bin)
    if(LLD)  # links in a quarter of GNU ld's time
      target_link_options(project_options INTERFACE -fuse-ld=lld)
    endif()
    # Frames of a shared run-time library are reported with its file, which tells them from the program's.
    if(sanitizer STREQUAL address)
      execute_process(COMMAND ${CMAKE_CXX_COMPILER} -print-runtime-dir OUTPUT_VARIABLE folder OUTPUT_STRIP_TRAILING_WHITESPACE)
      target_link_options(project_options INTERFACE -shared-libasan LINKER:-rpath,${folder})
    endif()
  endif()
endif()
if(SMARTSURF_FUZZ)
  target_compile_options(project_options INTERFACE -fsanitize=fuzzer-no-link)  # what guides libFuzzer
endif()

# add_module(<program> <module> SOURCES … [MODULES …] [PRIVATE …] [PUBLIC …])
#   MODULES: modules that this one may include (targets); PRIVATE: third-party libraries that only this module sees;
#   PUBLIC: third-party libraries that appear in its headers.
#   OPTIMISED: it computes over arrays: compiled with SMARTSURF_OPTIMISED_OPTIONS where the others take the least time.
# The target is <program>_<module>.
function(add_module program module)
  cmake_parse_arguments(M "OPTIMISED" "" "SOURCES;MODULES;PRIVATE;PUBLIC" ${ARGN})
  set(target ${program}_${module})
  add_library(${target} STATIC ${M_SOURCES})
  target_link_libraries(${target} PUBLIC project_options ${M_MODULES} ${M_PUBLIC} PRIVATE ${M_PRIVATE})
  if(M_OPTIMISED AND SMARTSURF_OPTIMISED_OPTIONS)  # a precompiled header is of one level of optimisation
    target_compile_options(${target} PRIVATE ${SMARTSURF_OPTIMISED_OPTIONS})
    set_target_properties(${target} PROPERTIES IS_OPTIMISED ON)
    if(program STREQUAL smartsurf)
      precompile(${target} precompiled_smartsurf_optimised)
    endif()
  elseif(program STREQUAL smartsurf)
    precompile(${target} precompiled_smartsurf)
  else()
    precompile(${target} precompiled_standard)
  endif()
  cmake_language(EVAL CODE "cmake_language(DEFER CALL join_sources ${target})")  # once all of its sources are known
endfunction()

# run_sanitized_only(<program> <test>): scripts/test builds and runs it under AddressSanitizer alone, unless it is called
# with --quick.
function(run_sanitized_only program test)
  set_property(GLOBAL APPEND PROPERTY sanitized_tests ${program})
  set_property(GLOBAL APPEND PROPERTY only_sanitized_tests ${program})
  set_property(TEST ${test} APPEND PROPERTY LABELS sanitized)
endfunction()

# compile_as_test(<target> <library>…): a program, linked with these, whose own code does little: compiled in the least time.
function(compile_as_test target)
  if("${ARGN}" MATCHES "smartsurf_")
    precompile(${target} precompiled_smartsurf_test)
  else()
    precompile(${target} precompiled_apron_test)
  endif()
  target_compile_options(${target} PRIVATE ${SMARTSURF_TEST_OPTIONS})
  target_compile_definitions(${target} PRIVATE GTEST_HAS_PTHREAD=1)  # as those of the precompiled headers
  set_target_properties(${target} PROPERTIES IS_UNIT_TEST ON)
  use_test_compiler(${target})
endfunction()
# use_test_compiler(<target>): SMARTSURF_TEST_COMPILER compiles its C++ files. CMake knows one compiler of a language: a
# launcher puts the other in its place.
if(SMARTSURF_TEST_COMPILER)
  unset(TEST_COMPILER CACHE)  # of another SMARTSURF_TEST_COMPILER
  find_program(TEST_COMPILER ${SMARTSURF_TEST_COMPILER})
  if(NOT TEST_COMPILER)
    message(STATUS "${SMARTSURF_TEST_COMPILER} was not found: ${CMAKE_CXX_COMPILER} compiles the tests, in twice the time")
  endif()
endif()
function(use_test_compiler target)
  if(SMARTSURF_TEST_COMPILER AND TEST_COMPILER)
    list(JOIN CMAKE_CXX_COMPILER_LAUNCHER " " launcher)
    string(STRIP "${launcher} ${TEST_COMPILER}" compiler)
    set_target_properties(${target} PROPERTIES CXX_COMPILER_LAUNCHER "${PROJECT_SOURCE_DIR}/cmake/compile-with;${compiler}")
    target_compile_options(${target} PRIVATE $<$<COMPILE_LANGUAGE:CXX>:-Wno-unknown-warning-option>)
  endif()
endfunction()
# What the tests are compiled with that compute or wait on their own.
if(SMARTSURF_SANITIZE)
  set(optimised_test_options ${SMARTSURF_OPTIMISED_OPTIONS})
endif()

# add_module_test(<name> SOURCES … LIBS …): one GoogleTest program, registered with ctest under LABEL [unit]: a unit test as a
# whole, because processes take longer to start than most cases take, and others case by case. scripts/test runs unit tests
# under AddressSanitizer alone, with the label `sanitized`, and all others, which compute more, optimised alone. With --quick,
# and in a build without sanitizers, both run.
# OPTIMISED: its own code compares millions of values, or is one side of a race; that of the others does little, and is
# compiled in the least time.
# LONG: a filter of a unit test's cases that take seconds. They run optimised, as <name>.long.
# NIGHTLY: a filter of cases, of those that run one by one, that take ten seconds or more: finer steps of what other cases
# try. They have the label `nightly`: scripts/test --all runs them.
# EACH_BUILD: a filter of a unit test's cases that run optimised too, as <name>.optimised, because sanitizer builds try fewer
# inputs (SanitizedCases.h), count no allocations (AllocationCounter.h) or compile kernels for one instruction set. `*`: all,
# as <name>.
# UNSANITIZED: a unit test that runs optimised alone, because its modules serve no other and would take a tenth of the build.
# THREADS: it runs threads inside one process, and has the label `threads`: what ThreadSanitizer runs.
# SERIAL: a filter of the cases that run one thread and take seconds; ThreadSanitizer leaves them out.
function(add_module_test name)
  cmake_parse_arguments(T "OPTIMISED;UNSANITIZED;THREADS" "LABEL;EACH_BUILD;LONG;NIGHTLY;SERIAL;TIMEOUT" "SOURCES;LIBS" ${ARGN})
  if(NOT T_LABEL)
    set(T_LABEL unit)
  endif()
  if(NOT T_TIMEOUT)
    set(T_TIMEOUT 600)
  endif()
  if(T_UNSANITIZED AND SMARTSURF_SANITIZE)
    return()
  endif()
  add_executable(${name} ${T_SOURCES})
  set(labels ${T_LABEL})
  if(T_LABEL STREQUAL "unit" AND NOT T_UNSANITIZED)
    set_property(GLOBAL APPEND PROPERTY sanitized_tests ${name})
    if(NOT T_EACH_BUILD STREQUAL "*")
      list(APPEND labels sanitized)
      if(NOT T_LONG AND NOT T_EACH_BUILD)
        set_property(GLOBAL APPEND PROPERTY only_sanitized_tests ${name})
      endif()
    endif()
  endif()
  if(T_THREADS)
    set_property(GLOBAL APPEND PROPERTY threaded_tests ${name})
    list(APPEND labels threads)
  endif()
  # The linker keeps the first copy of an inline function that it meets: the optimised modules' own, not that of a test.
  foreach(library IN LISTS T_LIBS)
    if(TARGET ${library})
      get_target_property(optimised ${library} IS_OPTIMISED)
      if(optimised)
        target_link_options(${name} PRIVATE "LINKER:--whole-archive,$<TARGET_FILE:${library}>,--no-whole-archive")
      endif()
    endif()
  endforeach()
  target_link_libraries(${name} PRIVATE project_options ${T_LIBS} GTest::gtest GTest::gtest_main)
  if(NOT T_OPTIMISED)
    compile_as_test(${name} ${T_LIBS})
  else()
    if(NOT "${T_LIBS}" MATCHES "smartsurf_")
      precompile(${name} precompiled_optimised_test)
    endif()
    target_compile_options(${name} PRIVATE ${optimised_test_options})
  endif()
  join_sources(${name})
  if(NOT T_LABEL STREQUAL "unit")
    gtest_discover_tests(${name} TEST_PREFIX "${name}." TEST_FILTER "-${T_NIGHTLY}" DISCOVERY_TIMEOUT 60
      PROPERTIES LABELS ${T_LABEL} TIMEOUT ${T_TIMEOUT})
    if(T_NIGHTLY)
      gtest_discover_tests(${name} TEST_PREFIX "${name}." TEST_FILTER "${T_NIGHTLY}" DISCOVERY_TIMEOUT 60
        PROPERTIES LABELS "${T_LABEL};nightly" TIMEOUT 3600)
    endif()
    return()
  endif()
  set(left_out ${T_LONG})
  if(SMARTSURF_SANITIZE MATCHES "thread")
    set(left_out ${T_SERIAL})
  endif()
  add_test(NAME ${name} COMMAND ${name} --gtest_filter=-${left_out})
  list(LENGTH T_SOURCES files)
  set_tests_properties(${name} PROPERTIES LABELS "${labels}" TIMEOUT 900 COST ${files})
  if(T_LONG AND NOT SMARTSURF_SANITIZE)
    add_test(NAME ${name}.long COMMAND ${name} --gtest_filter=${T_LONG})
    set_tests_properties(${name}.long PROPERTIES LABELS "unit;long" TIMEOUT 900 COST 40)
  endif()
  if(T_EACH_BUILD AND NOT T_EACH_BUILD STREQUAL "*" AND NOT SMARTSURF_SANITIZE)
    add_test(NAME ${name}.optimised COMMAND ${name} --gtest_filter=${T_EACH_BUILD})
    set_tests_properties(${name}.optimised PROPERTIES LABELS unit TIMEOUT 900)
  endif()
endfunction()
