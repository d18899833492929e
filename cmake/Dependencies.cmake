# Everything from Debian 12; scripts/setup names the packages. Nothing is downloaded at configure time.
find_package(PkgConfig REQUIRED)
find_package(Threads REQUIRED)
find_package(Eigen3 REQUIRED NO_MODULE)
# Eigen's results on aarch64 are those on x86-64: without fused products, which its intrinsics use where the macro stands and
# -ffp-contract does not govern, and without the packets of two floats, which sum a vector of three in another order. The
# headers that the product includes are followed by EigenPackets.h.
if(CMAKE_SYSTEM_PROCESSOR MATCHES "aarch64|arm64")
  foreach(header Cholesky Core Eigenvalues Geometry LU SparseCholesky)
    file(CONFIGURE OUTPUT ${PROJECT_BINARY_DIR}/eigen/Eigen/${header}
      CONTENT "#include_next <Eigen/${header}>\n#include \"${PROJECT_SOURCE_DIR}/cmake/EigenPackets.h\"\n")
  endforeach()
  target_include_directories(Eigen3::Eigen BEFORE INTERFACE ${PROJECT_BINARY_DIR}/eigen)
  target_compile_options(Eigen3::Eigen INTERFACE -U__ARM_FEATURE_FMA)
endif()
if(POLICY CMP0167)
  cmake_policy(SET CMP0167 NEW)                   # Boost's own package, where CMake has no module
endif()
find_package(Boost REQUIRED)                      # Interprocess, header only
find_package(fmt REQUIRED)
find_package(nlohmann_json REQUIRED)
# Its assertions fail in destructors of values whose allocation failed.
set_property(TARGET nlohmann_json::nlohmann_json APPEND PROPERTY INTERFACE_COMPILE_OPTIONS "-DJSON_ASSERT(x)=static_cast<void>(0)")
find_package(CLI11 REQUIRED)
find_package(HDF5 REQUIRED COMPONENTS C)
find_package(PNG REQUIRED)
# The C++ build of Lua unwinds C++ destructors when luaL_error is raised; the C build longjmps over them.
pkg_check_modules(LUA REQUIRED IMPORTED_TARGET lua5.4-c++)
pkg_check_modules(ASSIMP REQUIRED IMPORTED_TARGET assimp)
pkg_check_modules(QHULL REQUIRED IMPORTED_TARGET qhull_r)
pkg_check_modules(SECCOMP REQUIRED IMPORTED_TARGET libseccomp)
pkg_check_modules(TINYXML2 REQUIRED IMPORTED_TARGET tinyxml2)
pkg_check_modules(TOMLPLUSPLUS REQUIRED IMPORTED_TARGET tomlplusplus)
if(SMARTSURF_VIEW)
  find_package(glfw3 REQUIRED)
  pkg_check_modules(EPOXY REQUIRED IMPORTED_TARGET epoxy)
  pkg_check_modules(EGL REQUIRED IMPORTED_TARGET egl)
  pkg_check_modules(IMGUI REQUIRED IMPORTED_TARGET imgui)
endif()
if(SMARTSURF_BULLET)
  pkg_check_modules(BULLET QUIET IMPORTED_TARGET bullet-float64)
  if(NOT BULLET_FOUND)
    message(STATUS "Bullet is not installed: engine 'bullet' is left out (scripts/setup installs it)")
  endif()
endif()
find_package(GTest QUIET)
