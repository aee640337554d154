# What a log says of the program that made it.
find_package(Git QUIET)
set(STANCE_COMMIT "unknown")
if(GIT_FOUND)
  execute_process(COMMAND ${GIT_EXECUTABLE} -C ${PROJECT_SOURCE_DIR} describe --always --dirty --abbrev=12
                  OUTPUT_VARIABLE STANCE_COMMIT OUTPUT_STRIP_TRAILING_WHITESPACE ERROR_QUIET)
endif()
add_library(stance_version INTERFACE)
target_compile_definitions(stance_version INTERFACE STANCE_VERSION="${PROJECT_VERSION}" STANCE_COMMIT="${STANCE_COMMIT}"
  STANCE_BUILD="${CMAKE_CXX_COMPILER_ID} ${CMAKE_CXX_COMPILER_VERSION} ${CMAKE_BUILD_TYPE}")
