# The live page's WebAssembly (docs/live-page.md): the modules that simulate and those that compile and run programs, for one
# thread and without windows, HDF5, Bullet, mesh files and native modules. `emcmake cmake --preset web` selects it.
#
# Debian has no libraries for this machine: Lua, Qhull, TinyXML-2, fmt, Highway and parts of newlib are compiled from its source packages
# (scripts/setup --web). Eigen, nlohmann-json and fast_float are headers.
include(cmake/Precompiled.cmake)
include(cmake/Unity.cmake)

set(web_sources ${PROJECT_SOURCE_DIR}/build/web-sources)
function(find_source variable pattern)
  file(GLOB found LIST_DIRECTORIES ON ${web_sources}/${pattern})
  if(NOT found)
    message(FATAL_ERROR "${web_sources}/${pattern} is missing: scripts/setup --web unpacks it")
  endif()
  list(GET found -1 found)
  set(${variable} ${found} PARENT_SCOPE)
endfunction()

set(web_headers ${PROJECT_BINARY_DIR}/headers)  # those of /usr/include that are of no machine
file(MAKE_DIRECTORY ${web_headers})
foreach(folder nlohmann fast_float eigen3)
  if(NOT IS_DIRECTORY /usr/include/${folder})
    message(FATAL_ERROR "/usr/include/${folder} is missing: scripts/setup --web installs it")
  endif()
endforeach()
file(CREATE_LINK /usr/include/nlohmann ${web_headers}/nlohmann SYMBOLIC)
file(CREATE_LINK /usr/include/fast_float ${web_headers}/fast_float SYMBOLIC)
# Eigen's results are those on x86-64, as on aarch64 (cmake/Dependencies.cmake): its headers are followed by the order of sums.
foreach(header Cholesky Core Eigenvalues Geometry LU SparseCholesky)
  set(followed "#include \"${PROJECT_SOURCE_DIR}/cmake/EigenSums.h\"\n")
  if(header STREQUAL Geometry)
    string(APPEND followed "#include \"${PROJECT_SOURCE_DIR}/cmake/EigenQuaternions.h\"\n")
  endif()
  file(CONFIGURE OUTPUT ${web_headers}/Eigen/${header}
    CONTENT "#pragma once\n#include \"/usr/include/eigen3/Eigen/${header}\"\n${followed}")
endforeach()

# Code of others: without our warnings, and with the same arithmetic.
function(add_foreign name)
  cmake_parse_arguments(F "" "" "SOURCES;INCLUDES;OPTIONS" ${ARGN})
  add_library(${name} STATIC ${F_SOURCES})
  target_include_directories(${name} SYSTEM PUBLIC ${F_INCLUDES})
  target_compile_options(${name} PRIVATE -w -ffp-contract=off ${F_OPTIONS})
endfunction()

find_source(lua lua5.4-*)
file(GLOB lua_sources ${lua}/src/l*.c)
list(FILTER lua_sources EXCLUDE REGEX "/(lua|luac)[.]c$")
# As C++, so that errors unwind (cmake/Dependencies.cmake).
set_source_files_properties(${lua_sources} PROPERTIES LANGUAGE CXX)
file(CONFIGURE OUTPUT ${web_headers}/lua/lua5.4-deb-multiarch.h CONTENT "#define DEB_HOST_MULTIARCH \"wasm32\"\n")  # of Debian's patch
add_foreign(web_lua SOURCES ${lua_sources} INCLUDES ${lua}/src ${web_headers}/lua OPTIONS -O2)
add_library(PkgConfig::LUA ALIAS web_lua)

find_source(qhull qhull-*)
file(GLOB qhull_sources ${qhull}/src/libqhull_r/*.c)
add_foreign(web_qhull SOURCES ${qhull_sources} INCLUDES ${qhull}/src)
add_library(PkgConfig::QHULL ALIAS web_qhull)

find_source(tinyxml2 tinyxml2-*)
add_foreign(web_tinyxml2 SOURCES ${tinyxml2}/tinyxml2.cpp INCLUDES ${tinyxml2})
add_library(PkgConfig::TINYXML2 ALIAS web_tinyxml2)

find_source(fmt fmtlib-*)
add_foreign(web_fmt SOURCES ${fmt}/src/format.cc INCLUDES ${fmt}/include)
add_library(fmt::fmt ALIAS web_fmt)

find_source(highway highway-*)
add_foreign(web_hwy SOURCES ${highway}/hwy/aligned_allocator.cc ${highway}/hwy/per_target.cc ${highway}/hwy/targets.cc
  INCLUDES ${highway})
add_library(hwy::hwy ALIAS web_hwy)
file(CREATE_LINK ${highway}/hwy ${web_headers}/hwy SYMBOLIC)  # headers of the modules include some of it
file(WRITE ${CMAKE_FIND_PACKAGE_REDIRECTS_DIR}/hwy-config.cmake "")  # the modules look for the package

# glibc's sine and cosine of floats, which it shares with newlib (smartsurf/web/live/Libm.cpp). Without newlib's other headers.
find_source(newlib newlib-*)
set(newlib_sources sinf.c cosf.c sincosf_data.c)
foreach(file ${newlib_sources} sincosf.h math_config.h)
  configure_file(${newlib}/newlib/libm/common/${file} ${PROJECT_BINARY_DIR}/newlib/${file} COPYONLY)
endforeach()
file(CONFIGURE OUTPUT ${PROJECT_BINARY_DIR}/newlib/fdlibm.h CONTENT "#define __OBSOLETE_MATH 0\n")
list(TRANSFORM newlib_sources PREPEND ${PROJECT_BINARY_DIR}/newlib/)
add_foreign(web_newlib SOURCES ${newlib_sources} OPTIONS -O2)

foreach(headers Eigen3::Eigen nlohmann_json::nlohmann_json)
  add_library(${headers} INTERFACE IMPORTED)
  target_include_directories(${headers} INTERFACE ${web_headers})
endforeach()
add_library(Threads::Threads INTERFACE IMPORTED)

# What libc++ 13 lacks, before its own headers.
add_library(web_libcxx STATIC ${PROJECT_SOURCE_DIR}/smartsurf/web/libcxx/FloatChars.cpp)
target_include_directories(web_libcxx BEFORE PUBLIC ${PROJECT_SOURCE_DIR}/smartsurf/web/libcxx)
target_include_directories(web_libcxx SYSTEM PUBLIC ${web_headers})
target_link_libraries(web_libcxx PRIVATE project_options fmt::fmt)
target_link_libraries(project_options INTERFACE web_libcxx)

add_module(common files SOURCES ${PROJECT_SOURCE_DIR}/common/files/AtomicFile.cpp ${PROJECT_SOURCE_DIR}/common/files/FileKind.cpp
  ${PROJECT_SOURCE_DIR}/common/files/Inputs.cpp ${PROJECT_SOURCE_DIR}/common/files/PreparedOutputs.cpp
  ${PROJECT_SOURCE_DIR}/common/files/ReadFile.cpp)
add_module(common process SOURCES ${PROJECT_SOURCE_DIR}/common/process/NoChildWork.cpp)
add_module(common csv SOURCES ${PROJECT_SOURCE_DIR}/common/csv/Csv.cpp)
add_module(common color SOURCES ${PROJECT_SOURCE_DIR}/common/color/Palette.cpp ${PROJECT_SOURCE_DIR}/common/color/PaletteFile.cpp)
add_module(common text SOURCES ${PROJECT_SOURCE_DIR}/common/text/Printable.cpp ${PROJECT_SOURCE_DIR}/common/text/Suggestion.cpp)
add_module(common threads SOURCES ${PROJECT_SOURCE_DIR}/common/threads/Core.cpp ${PROJECT_SOURCE_DIR}/common/threads/ThreadPool.cpp)
foreach(module apron/syntax apron/program apron/compiler apron/vm apron/library smartsurf/scene smartsurf/mesh smartsurf/model
    smartsurf/script smartsurf/surface smartsurf/world smartsurf/simulation)
  add_subdirectory(${module})
endforeach()
# Highway 1.0.3 has no vectors of doubles for WebAssembly.
set(portable_vectors -UHWY_COMPILE_ONLY_STATIC -DHWY_COMPILE_ONLY_EMU128)
set_source_files_properties(${PROJECT_SOURCE_DIR}/smartsurf/world/body/RotationKernels.cpp
  TARGET_DIRECTORY smartsurf_world PROPERTIES COMPILE_OPTIONS "${portable_vectors}")
set(kernels ${PROJECT_SOURCE_DIR}/apron/vm/kernels)
set_source_files_properties(${kernels}/Kernels.cpp ${kernels}/MathematicsKernels.cpp ${kernels}/RandomKernels.cpp
  ${kernels}/FilterKernels.cpp
  TARGET_DIRECTORY apron_vm PROPERTIES COMPILE_OPTIONS "${portable_vectors}")
set_source_files_properties(${PROJECT_SOURCE_DIR}/apron/vm/kernels/IntegerKernels.cpp
  TARGET_DIRECTORY apron_vm PROPERTIES COMPILE_OPTIONS "-O3;${portable_vectors}")
add_subdirectory(smartsurf/web/live)
