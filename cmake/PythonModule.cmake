# Finds what the compiled parts of the Python packages need; without it the packages are left out.
if(NOT SKBUILD AND NOT DEFINED Python_ROOT_DIR)
  set(Python_ROOT_DIR /usr)  # Debian's, with which the tests run
endif()
find_package(Python 3.9 QUIET COMPONENTS Interpreter Development.Module)
find_package(pybind11 2.10 QUIET CONFIG)
if(NOT (Python_Development.Module_FOUND AND pybind11_FOUND))
  message(STATUS "pybind11 or Python's headers are not installed: the Python packages are left out (scripts/setup installs them)")
endif()
