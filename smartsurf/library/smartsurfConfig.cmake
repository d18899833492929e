# smartsurf::smartsurf is the library; smartsurf::plugin what an extension is compiled with.
include(${CMAKE_CURRENT_LIST_DIR}/smartsurfTargets.cmake)
