# `cmake --build … --target api_docs`: the API pages of the public headers, in api/html of the build folder. A warning of
# Doxygen's is an error, and a test.
find_program(DOXYGEN doxygen)
if(DOXYGEN)
  configure_file(docs/api/Doxyfile.in ${PROJECT_BINARY_DIR}/api/Doxyfile @ONLY)
  add_custom_target(api_docs COMMAND ${DOXYGEN} ${PROJECT_BINARY_DIR}/api/Doxyfile
    COMMENT "Writing ${PROJECT_BINARY_DIR}/api/html" VERBATIM)
endif()
