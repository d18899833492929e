# What `cmake --install` and `cpack -G DEB` install. The protocol's own part, which other programs build on, is the
# component shm_protocol (shm-protocol/CMakeLists.txt).
include(GNUInstallDirs)

# The one program here that links the shared library finds it beside itself, wherever the tree is put.
set_target_properties(fake_surface PROPERTIES INSTALL_RPATH "$ORIGIN/../${CMAKE_INSTALL_LIBDIR}")
install(TARGETS smartsurf apron surface_bridge fake_surface device_emulator)
if(SKBUILD)  # the wheel of the Python package, whose smartsurf.run() starts them
  install(TARGETS smartsurf apron RUNTIME DESTINATION ${SKBUILD_SCRIPTS_DIR} COMPONENT python)
  install(DIRECTORY scripts/apron scripts/apron-examples scripts/case-study scripts/conveyors scripts/examples scripts/extensions scripts/gallery scripts/tasks
    DESTINATION ${SKBUILD_DATA_DIR}/share/smartsurf COMPONENT python PATTERN table EXCLUDE)
endif()
# Where scripts/wheel has built the libraries that it links in: the wheel names them all in its notices, and brings a font.
set(SMARTSURF_WHEEL "" CACHE PATH "Folder of the libraries' source packages, for a wheel that needs no other package")
if(SMARTSURF_WHEEL)
  foreach(font DejaVuSans DejaVuSans-Bold DejaVuSansMono)
    install(FILES /usr/share/fonts/truetype/dejavu/${font}.ttf DESTINATION ${SKBUILD_DATA_DIR}/share/smartsurf/fonts COMPONENT python)
  endforeach()
endif()
install(PROGRAMS scripts/doctor DESTINATION ${CMAKE_INSTALL_BINDIR} RENAME smartsurf-doctor)

# Where an installed apron looks for its library: ../share/smartsurf/apron (apron/run/options/CompiledProgram.cpp).
install(DIRECTORY scripts/apron scripts/apron-examples scripts/scamp5 scripts/case-study scripts/conveyors scripts/examples scripts/extensions scripts/gallery
  scripts/tasks DESTINATION ${CMAKE_INSTALL_DATADIR}/smartsurf PATTERN table EXCLUDE)
install(DIRECTORY shm-protocol/examples/ DESTINATION ${CMAKE_INSTALL_DATADIR}/smartsurf/controllers
  PATTERN __pycache__ EXCLUDE)
install(DIRECTORY shm-protocol/hardware/firmware DESTINATION ${CMAKE_INSTALL_DATADIR}/smartsurf)
install(FILES shm-protocol/hardware/boards/servo_board.c DESTINATION ${CMAKE_INSTALL_DATADIR}/smartsurf/firmware)

# What find_package(smartsurf) and pkg-config find: the library, and the headers of extensions and modules.
include(CMakePackageConfigHelpers)
set(library_folder ${CMAKE_INSTALL_LIBDIR}/cmake/smartsurf)
install(TARGETS smartsurf_library smartsurf_plugin EXPORT smartsurfTargets COMPONENT library
  LIBRARY DESTINATION ${CMAKE_INSTALL_LIBDIR})
install(FILES smartsurf/library/smartsurf.h smartsurf/library/smartsurf.hpp smartsurf/extension/smartsurf_plugin.h
  DESTINATION ${CMAKE_INSTALL_INCLUDEDIR}/smartsurf COMPONENT library)
install(FILES apron/run/apron_plugin.h DESTINATION ${CMAKE_INSTALL_INCLUDEDIR}/apron COMPONENT library)
install(EXPORT smartsurfTargets NAMESPACE smartsurf:: DESTINATION ${library_folder} COMPONENT library)
write_basic_package_version_file(${PROJECT_BINARY_DIR}/smartsurfConfigVersion.cmake COMPATIBILITY SameMinorVersion)
install(FILES smartsurf/library/smartsurfConfig.cmake ${PROJECT_BINARY_DIR}/smartsurfConfigVersion.cmake
  DESTINATION ${library_folder} COMPONENT library)
# From the .pc file back to the prefix, so that an installed tree may be moved.
file(RELATIVE_PATH smartsurf_prefix "/${CMAKE_INSTALL_LIBDIR}/pkgconfig" "/")
configure_file(smartsurf/library/smartsurf.pc.in smartsurf.pc @ONLY)
install(FILES ${PROJECT_BINARY_DIR}/smartsurf.pc DESTINATION ${CMAKE_INSTALL_LIBDIR}/pkgconfig COMPONENT library)

install(DIRECTORY docs/ DESTINATION ${CMAKE_INSTALL_DOCDIR} FILES_MATCHING PATTERN "*.md" PATTERN "*.png" PATTERN "*.svg" PATTERN "*.webp"
  PATTERN api EXCLUDE)
install(FILES shm-protocol/PROTOCOL.md shm-protocol/hardware/BYTE-PROTOCOL.md DESTINATION ${CMAKE_INSTALL_DOCDIR})
# What is linked or contained, with the licences, and as SPDX; in the wheel too, where the linker's maps tell it.
find_program(NOTICES_PYTHON python3 REQUIRED)
set(write_notices ${NOTICES_PYTHON} ${PROJECT_SOURCE_DIR}/packaging/notices --version ${PROJECT_VERSION}
  --out ${PROJECT_BINARY_DIR}/notices)
if(SMARTSURF_WHEEL)
  list(APPEND write_notices --wheel ${SMARTSURF_WHEEL} --maps ${PROJECT_BINARY_DIR})
  list(JOIN write_notices "\" \"" write_notices)
  install(CODE "execute_process(COMMAND \"${write_notices}\" COMMAND_ERROR_IS_FATAL ANY)" COMPONENT python)
else()
  execute_process(COMMAND ${write_notices} COMMAND_ERROR_IS_FATAL ANY)
endif()
set_property(DIRECTORY APPEND PROPERTY CMAKE_CONFIGURE_DEPENDS ${PROJECT_SOURCE_DIR}/packaging/third-party.csv)
set(notices ${PROJECT_BINARY_DIR}/notices/THIRD-PARTY.txt ${PROJECT_BINARY_DIR}/notices/smartsurf.spdx.json)
install(FILES ${notices} DESTINATION ${CMAKE_INSTALL_DOCDIR})
if(SKBUILD)
  install(FILES ${notices} DESTINATION smartsurf COMPONENT python)
endif()
install(FILES editors/README.md DESTINATION ${CMAKE_INSTALL_DOCDIR} RENAME editors.md)
# Debian reads a package's license from a file of this name.
install(FILES LICENSE DESTINATION ${CMAKE_INSTALL_DOCDIR} RENAME copyright)
# Installed, the protocols and the page about editors lie beside the pages that link to them.
install(CODE "set(folder \"${CMAKE_INSTALL_DOCDIR}\")")
install(CODE [[
  cmake_path(ABSOLUTE_PATH folder BASE_DIRECTORY "${CMAKE_INSTALL_PREFIX}")
  file(GLOB pages "$ENV{DESTDIR}${folder}/*.md")
  foreach(page IN LISTS pages)
    file(READ "${page}" text)
    string(REPLACE "](../shm-protocol/PROTOCOL.md" "](PROTOCOL.md" mended "${text}")
    string(REPLACE "](../shm-protocol/hardware/BYTE-PROTOCOL.md" "](BYTE-PROTOCOL.md" mended "${mended}")
    string(REPLACE "](../editors/README.md" "](editors.md" mended "${mended}")
    string(REPLACE "](../docs/" "](" mended "${mended}")
    if(NOT mended STREQUAL text)
      file(WRITE "${page}" "${mended}")
    endif()
  endforeach()]])
file(GLOB man_pages CONFIGURE_DEPENDS ${PROJECT_SOURCE_DIR}/packaging/man/*.1)
install(FILES ${man_pages} DESTINATION ${CMAKE_INSTALL_MANDIR}/man1)
install(FILES packaging/smartsurf.bash-completion
  DESTINATION ${CMAKE_INSTALL_DATADIR}/bash-completion/completions RENAME smartsurf)
foreach(program apron shm_dump)
  install(FILES packaging/smartsurf.bash-completion
    DESTINATION ${CMAKE_INSTALL_DATADIR}/bash-completion/completions RENAME ${program})
endforeach()
foreach(program smartsurf apron shm_dump)  # fish reads the file named like the command
  install(FILES packaging/smartsurf.fish-completion
    DESTINATION ${CMAKE_INSTALL_DATADIR}/fish/vendor_completions.d RENAME ${program}.fish)
endforeach()
foreach(folder vendor-completions site-functions)  # searched by zsh under /usr (Debian) and /usr/local
  install(FILES packaging/smartsurf.zsh-completion DESTINATION ${CMAKE_INSTALL_DATADIR}/zsh/${folder} RENAME _smartsurf)
endforeach()
install(FILES packaging/smartsurf.desktop packaging/apron.desktop DESTINATION ${CMAKE_INSTALL_DATADIR}/applications)

set(CPACK_PACKAGE_NAME smartsurf)
set(CPACK_PACKAGE_VENDOR "The SmartSurf developers")
set(CPACK_RESOURCE_FILE_LICENSE ${PROJECT_SOURCE_DIR}/LICENSE)
set(CPACK_PACKAGE_CONTACT "The SmartSurf developers <smartsurf@localhost>")
set(CPACK_PACKAGE_DESCRIPTION_SUMMARY "${PROJECT_DESCRIPTION}")
set(CPACK_PACKAGING_INSTALL_PREFIX /usr)
set(CPACK_STRIP_FILES ON)
set(CPACK_GENERATOR DEB)
set(CPACK_DEBIAN_FILE_NAME DEB-DEFAULT)
set(CPACK_DEBIAN_PACKAGE_SECTION science)
set(CPACK_DEBIAN_PACKAGE_SHLIBDEPS ON)
set(CPACK_DEBIAN_PACKAGE_DEPENDS "libegl1, libgl1-mesa-dri, fonts-dejavu-core")
set(CPACK_DEBIAN_PACKAGE_RECOMMENDS "ffmpeg, python3-numpy")
# The shared library lies where the loader looks; the package says so, as Debian's own do.
set(CPACK_DEBIAN_PACKAGE_GENERATE_SHLIBS ON)
set(CPACK_DEBIAN_PACKAGE_CONTROL_STRICT_PERMISSION ON)
include(CPack)
