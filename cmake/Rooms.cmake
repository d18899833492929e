# One static library per room of the house (docs/architecture.md), compiled the same way everywhere.

add_library(house_rules INTERFACE)
# -ffp-contract=off: GCC fuses a*b+c into one FMA wherever the target has it, so the same source would round
# differently from one function, compiler or machine to the next. Determinism is a promise here, so every
# multiply and every add rounds on its own; kernels that want an FMA must write it.
target_compile_options(house_rules INTERFACE
  -ffp-contract=off
  -fno-math-errno   # lets loops over sqrt vectorise; nobody reads errno after it, and no result changes
  -Wall -Wextra -Wpedantic -Wshadow
  # GCC 12 sees overlaps in std::string's operator+ that are not there (PR 105651).
  $<$<CXX_COMPILER_ID:GNU>:-Wno-restrict>
  $<$<COMPILE_LANGUAGE:CXX>:-Wnon-virtual-dtor -Woverloaded-virtual>
  $<$<BOOL:${SMARTSURF_WERROR}>:-Werror>)
target_include_directories(house_rules INTERFACE ${PROJECT_SOURCE_DIR})
target_compile_definitions(house_rules INTERFACE SMARTSURF_VERSION="${PROJECT_VERSION}")
# The instruction sets that vector kernels are compiled for. SSSE3 alone is not worth a copy: the baseline or SSE4 serve
# such a CPU. Under sanitizers, where one such file takes longer than all others of its room, the baseline and AVX2 do.
if(SMARTSURF_SANITIZE)
  target_compile_definitions(house_rules INTERFACE "HWY_DISABLED_TARGETS=(HWY_SSSE3|HWY_SSE4|HWY_AVX3)")
else()
  target_compile_definitions(house_rules INTERFACE HWY_DISABLED_TARGETS=HWY_SSSE3)
endif()
if(SMARTSURF_SANITIZE)
  target_compile_options(house_rules INTERFACE -fsanitize=${SMARTSURF_SANITIZE} -fno-omit-frame-pointer
    -fno-sanitize-recover=all)
  # What AddressSanitizer stops at anyway is not looked at twice: a third less to compile. Addresses that are not aligned
  # can only come out of another process's bytes. A unit test's own code is not what is tested.
  if(SMARTSURF_SANITIZE MATCHES "address.*undefined")
    target_compile_options(house_rules INTERFACE
      -fno-sanitize=null,object-size,vptr,nonnull-attribute,returns-nonnull-attribute
      $<$<NOT:$<BOOL:$<TARGET_PROPERTY:TAKES_FOREIGN_BYTES>>>:-fno-sanitize=alignment>
      $<$<BOOL:$<TARGET_PROPERTY:IS_UNIT_TEST>>:-fno-sanitize=undefined>)
  endif()
  target_link_options(house_rules INTERFACE -fsanitize=${SMARTSURF_SANITIZE})
endif()

# add_room(<house> <room> SOURCES … [ROOMS …] [PRIVATE …] [PUBLIC …])
#   ROOMS: rooms this one may include (targets); PRIVATE: third-party libraries that only this room may see;
#   PUBLIC: third-party libraries that appear in its headers.
# The target is <house>_<room>.
function(add_room house room)
  cmake_parse_arguments(ROOM "" "" "SOURCES;ROOMS;PRIVATE;PUBLIC" ${ARGN})
  set(target ${house}_${room})
  add_library(${target} STATIC ${ROOM_SOURCES})
  target_link_libraries(${target} PUBLIC house_rules ${ROOM_ROOMS} ${ROOM_PUBLIC} PRIVATE ${ROOM_PRIVATE})
  precompile(${target} precompiled_${house})
endfunction()

# add_room_test(<name> SOURCES … LIBS …): one GoogleTest program, registered with ctest under the label
# "unit": case by case, or as a whole under AddressSanitizer. OPTIMISED: its own code compares millions of values,
# or is one side of a race; that of the others does little, and is compiled in the least time.
function(add_room_test name)
  cmake_parse_arguments(T "OPTIMISED" "LABEL;TIMEOUT" "SOURCES;LIBS" ${ARGN})
  if(NOT T_LABEL)
    set(T_LABEL unit)
  endif()
  if(NOT T_TIMEOUT)
    set(T_TIMEOUT 120)
  endif()
  add_executable(${name} ${T_SOURCES})
  if(T_LABEL MATCHES "unit|property")
    set_property(GLOBAL APPEND PROPERTY sanitized_tests ${name})
  endif()
  target_link_libraries(${name} PRIVATE house_rules ${T_LIBS} GTest::gtest GTest::gtest_main)
  if(NOT T_OPTIMISED)
    if("${T_LIBS}" MATCHES "smartsurf_")
      precompile(${name} precompiled_smartsurf_test)
    else()
      precompile(${name} precompiled_apron_test)
    endif()
    target_compile_options(${name} PRIVATE ${SMARTSURF_TEST_OPTIONS})
    set_target_properties(${name} PROPERTIES IS_UNIT_TEST ON)
  endif()
  if(SMARTSURF_SANITIZE MATCHES "address")
    # Such a process takes longer to start and to look for leaks than most cases take.
    add_test(NAME ${name} COMMAND ${name})
    list(LENGTH T_SOURCES files)
    set_tests_properties(${name} PROPERTIES LABELS ${T_LABEL} TIMEOUT 900 COST ${files})
  else()
    gtest_discover_tests(${name} TEST_PREFIX "${name}." DISCOVERY_TIMEOUT 60
      PROPERTIES LABELS ${T_LABEL} TIMEOUT ${T_TIMEOUT})
  endif()
endfunction()
