# Everything from Debian 12; scripts/setup names the packages. Nothing is downloaded at configure time.
find_package(PkgConfig REQUIRED)
find_package(Threads REQUIRED)
find_package(Eigen3 REQUIRED NO_MODULE)
find_package(Boost REQUIRED)                      # Interprocess, header only
find_package(fmt REQUIRED)
find_package(nlohmann_json REQUIRED)
find_package(CLI11 REQUIRED)
find_package(HDF5 REQUIRED COMPONENTS C)
find_package(PNG REQUIRED)
# The C++ build of Lua unwinds C++ destructors when luaL_error is raised; the C build longjmps over them.
pkg_check_modules(LUA REQUIRED IMPORTED_TARGET lua5.4-c++)
if(SMARTSURF_VIEW)
  find_package(glfw3 REQUIRED)
  pkg_check_modules(EPOXY REQUIRED IMPORTED_TARGET epoxy)
  pkg_check_modules(EGL REQUIRED IMPORTED_TARGET egl)
  pkg_check_modules(IMGUI REQUIRED IMPORTED_TARGET imgui)
endif()
find_package(GTest QUIET)
