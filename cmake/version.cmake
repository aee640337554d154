# What a log says of the program that made it.
find_package(Git QUIET)
set(STANCE_COMMIT "unknown")
if(GIT_FOUND)
  execute_process(COMMAND ${GIT_EXECUTABLE} -C ${PROJECT_SOURCE_DIR} describe --always --dirty --abbrev=12
                  OUTPUT_VARIABLE STANCE_COMMIT OUTPUT_STRIP_TRAILING_WHITESPACE ERROR_QUIET)
endif()
# The commit in a header of its own: a new one compiles again only what says it.
file(CONFIGURE OUTPUT "${PROJECT_BINARY_DIR}/version/stance_commit.hpp" CONTENT "#define STANCE_COMMIT \"${STANCE_COMMIT}\"\n")
add_library(stance_version INTERFACE)
target_include_directories(stance_version INTERFACE "${PROJECT_BINARY_DIR}/version")
target_compile_definitions(stance_version INTERFACE STANCE_VERSION="${PROJECT_VERSION}"
  STANCE_BUILD="${CMAKE_CXX_COMPILER_ID} ${CMAKE_CXX_COMPILER_VERSION} ${CMAKE_BUILD_TYPE}")
