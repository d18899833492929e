# Joined sources: a target's files are compiled sixteen at a time, so that headers and templates are compiled once for
# sixteen. All presets but debug and coverage use it; debug, and with it scripts/lint, compiles each file alone, which shows
# that it is complete.
option(SMARTSURF_UNITY "Compile the files of a target together" OFF)
if(SMARTSURF_UNITY)
  target_compile_options(project_options INTERFACE
    $<$<COMPILE_LANGUAGE:CXX>:-Wno-subobject-linkage>  # takes a joined file's anonymous namespace for a header's
    $<$<CXX_COMPILER_ID:GNU>:-Wno-stringop-overflow>)  # GCC 12: false overruns of moved std::strings
endif()

# Files whose anonymous namespace has a name that another file of the target has as well, and vector kernels, which
# include themselves once per instruction set.
set(unity_separate_files
  apron/syntax/Formatter.cpp
  apron/vm/kernels/Kernels.cpp
  smartsurf/mesh/MeshFile.cpp
  smartsurf/record/plot/TimeSpentPlot.cpp smartsurf/record/plot/TrajectoryPlot.cpp
  smartsurf/scene/SensorSpec.cpp
  smartsurf/surface/actuators/PinKernels.cpp smartsurf/surface/raycast/RayKernels.cpp
  smartsurf/world/StateHash.cpp smartsurf/world/broadphase/UniformGridKernels.cpp smartsurf/world/solver/ContactKernels.cpp
  smartsurf/world/body/RotationKernels.cpp smartsurf/world/solver/SupportKernels.cpp
  smartsurf/script/declarations/SensorDeclarations.cpp smartsurf/script/runtime/ObjectHandles.cpp
  smartsurf/view/interaction/Overlay.cpp smartsurf/view/model/Trails.cpp smartsurf/view/panels/InspectorPanel.cpp
  tests/system/shm-protocol/SoakTest.cpp
  tests/unit/apron/compiler/MacroExpansionTest.cpp
  tests/unit/apron/vm/ShiftTest.cpp
  tests/unit/smartsurf/mesh/ShellOrientationTest.cpp
  tests/unit/smartsurf/view/ToolsTest.cpp)

# join_sources(<target>): joins the target's files, if SMARTSURF_UNITY is on.
function(join_sources target)
  if(NOT SMARTSURF_UNITY)
    return()
  endif()
  set_target_properties(${target} PROPERTIES UNITY_BUILD ON UNITY_BUILD_BATCH_SIZE 16)
  get_target_property(sources ${target} SOURCES)
  foreach(source IN LISTS sources)
    cmake_path(ABSOLUTE_PATH source NORMALIZE OUTPUT_VARIABLE file)
    cmake_path(RELATIVE_PATH file BASE_DIRECTORY ${PROJECT_SOURCE_DIR})
    if(file IN_LIST unity_separate_files)
      set_source_files_properties(${source} PROPERTIES SKIP_UNITY_BUILD_INCLUSION ON)
    endif()
  endforeach()
endfunction()
