# Joined sources: files of a target are compiled as one, so that headers and templates are compiled once for all of them.
# All presets but debug and coverage use it; debug, and with it scripts/lint, compiles each file alone, which shows that it
# is complete. The presets of the sanitizers join up to 64 files: Clang then takes a sixth less processor time. The others join
# 16, so that an edit compiles in seconds.
option(SMARTSURF_UNITY "Compile the files of a target together" OFF)
set(SMARTSURF_UNITY_FILES 16 CACHE STRING "How many files of a target are compiled together at most")
if(SMARTSURF_UNITY)
  target_compile_options(project_options INTERFACE
    $<$<COMPILE_LANG_AND_ID:CXX,GNU>:-Wno-subobject-linkage>  # takes a joined file's anonymous namespace for a header's
    $<$<COMPILE_LANG_AND_ID:CXX,GNU>:-Wno-stringop-overflow>)  # GCC 12: false overruns of moved std::strings
endif()

# read_private_names(<file> <variable>): the names that may occur once in a batch: a file's macros, and what its anonymous
# namespaces and `static` declare in the first column. That includes functions, whose overloads in two files could be
# ambiguous. Aliases (using, namespace) are left out, because equal ones do not clash.
function(read_private_names file variable)
  file(READ ${file} text)
  string(REPLACE "\n[[noreturn]] " "\n" text "\n${text}")
  string(REPLACE ";" "," text "${text}")  # semicolons and brackets have a meaning in CMake's lists
  string(REGEX REPLACE "[][]" "{" text "${text}")
  string(REGEX MATCHALL "\n[#A-Za-z}][^\n]*" lines "${text}")
  set(names "")
  set(anonymous OFF)
  foreach(line IN LISTS lines)
    if(line STREQUAL "\nnamespace {")
      set(anonymous ON)
    elseif(line STREQUAL "\n}  // namespace")
      set(anonymous OFF)
    elseif(line MATCHES "^\n#define ([A-Za-z0-9_]+)[( ]")
      list(APPEND names ${CMAKE_MATCH_1})
    elseif(NOT (anonymous OR line MATCHES "^\nstatic ") OR line MATCHES "^\n(static_assert|TEST|INSTANTIATE_|namespace|using|void main|layout)")
      continue()
    elseif(line MATCHES "^\n(struct|class|enum class|enum) ([A-Za-z0-9_]+)")
      list(APPEND names ${CMAKE_MATCH_2})
    elseif(line MATCHES "^\n[^={(]+[^A-Za-z0-9_]([A-Za-z0-9_]+) *[={(]")
      set(name ${CMAKE_MATCH_1})
      string(REGEX MATCHALL ", \\*?k[A-Z][A-Za-z0-9]* =" more "${line}")  # constants that are declared together
      string(REGEX REPLACE "[, *=]" "" more "${more}")
      list(APPEND names ${name} ${more})
    endif()
  endforeach()
  set(${variable} "${names}" PARENT_SCOPE)
endfunction()

# join_sources(<target>): joins the target's files, if SMARTSURF_UNITY is on. Each file goes into the first batch that has
# room and none of its private names. Vector kernels stay alone, because they include themselves once per instruction set.
# The files are scanned when CMake configures: after an edit that adds a clash the compiler reports a redefinition, and
# configuring again separates the two files.
function(join_sources target)
  if(NOT SMARTSURF_UNITY)
    return()
  endif()
  set_target_properties(${target} PROPERTIES UNITY_BUILD ON UNITY_BUILD_MODE GROUP)
  get_target_property(sources ${target} SOURCES)
  foreach(source IN LISTS sources)
    cmake_path(ABSOLUTE_PATH source NORMALIZE OUTPUT_VARIABLE file)
    if(NOT file MATCHES "[.]cpp$" OR NOT EXISTS ${file})
      continue()
    endif()
    file(STRINGS ${file} kernel REGEX "hwy/foreach_target[.]h" LIMIT_COUNT 1)
    if(kernel)
      continue()
    endif()
    read_private_names(${file} names)
    set(batch 0)
    while(DEFINED size_${batch})
      set(others ${names_${batch}})
      list(REMOVE_ITEM others ${names})
      list(LENGTH others rest)
      if(rest EQUAL count_${batch} AND size_${batch} LESS SMARTSURF_UNITY_FILES)
        break()
      endif()
      math(EXPR batch "${batch} + 1")
    endwhile()
    list(APPEND names_${batch} ${names})
    list(LENGTH names_${batch} count_${batch})
    math(EXPR size_${batch} "0${size_${batch}} + 1")
    set_source_files_properties(${source} PROPERTIES UNITY_GROUP ${batch})
  endforeach()
endfunction()
