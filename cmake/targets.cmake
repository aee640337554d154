# The flags of our own targets, and nothing else's.
add_library(stance_flags INTERFACE)
target_compile_options(stance_flags INTERFACE
  -Wall -Wextra -Wpedantic -Wshadow -Wnon-virtual-dtor -Wold-style-cast -Wcast-align -Woverloaded-virtual -Wconversion -Wno-sign-conversion
  -Wdouble-promotion -Wformat=2 -Wimplicit-fallthrough -Werror
  # The same bits on every machine: no contraction to fused multiply-add behind the code's back.
  -ffp-contract=off)
if(STANCE_SANITIZE)
  target_compile_options(stance_flags INTERFACE -fsanitize=${STANCE_SANITIZE} -fno-sanitize-recover=all -fno-omit-frame-pointer)
  target_link_options(stance_flags INTERFACE -fsanitize=${STANCE_SANITIZE})
  # GCC 12 warns of Eigen's own code under sanitizers.
  target_compile_options(stance_flags INTERFACE -Wno-maybe-uninitialized)
endif()

set(STANCE_LIBRARIES "")

# stance_add_library(NAME SOURCES ... [DEPENDS ...]): one library a folder, `stance::NAME`, with the repository as include root.
function(stance_add_library name)
  cmake_parse_arguments(ARG "" "" "SOURCES;DEPENDS;PRIVATE_DEPENDS" ${ARGN})
  set(target stance_${name})
  if(ARG_SOURCES)
    add_library(${target} STATIC ${ARG_SOURCES})
    target_include_directories(${target} PUBLIC $<BUILD_INTERFACE:${PROJECT_SOURCE_DIR}> $<INSTALL_INTERFACE:${CMAKE_INSTALL_INCLUDEDIR}/stance>)
    target_link_libraries(${target} PUBLIC ${ARG_DEPENDS} PRIVATE $<BUILD_INTERFACE:stance_flags> ${ARG_PRIVATE_DEPENDS})
    target_compile_features(${target} PUBLIC cxx_std_20)
  else()
    add_library(${target} INTERFACE)
    target_include_directories(${target} INTERFACE $<BUILD_INTERFACE:${PROJECT_SOURCE_DIR}> $<INSTALL_INTERFACE:${CMAKE_INSTALL_INCLUDEDIR}/stance>)
    target_link_libraries(${target} INTERFACE ${ARG_DEPENDS})
    target_compile_features(${target} INTERFACE cxx_std_20)
  endif()
  set_target_properties(${target} PROPERTIES EXPORT_NAME ${name})
  add_library(stance::${name} ALIAS ${target})
  set_property(GLOBAL APPEND PROPERTY STANCE_LIBRARIES ${target})
endfunction()

# What the demo needs, without tests and benchmarks.
add_custom_target(programs)

# stance_add_program(NAME SOURCES ... DEPENDS ...): an executable, installed.
function(stance_add_program name)
  cmake_parse_arguments(ARG "" "" "SOURCES;DEPENDS" ${ARGN})
  add_executable(${name} ${ARG_SOURCES})
  target_link_libraries(${name} PRIVATE ${ARG_DEPENDS} stance_flags)
  set_target_properties(${name} PROPERTIES INSTALL_RPATH "${STANCE_SITE_PACKAGES}/lib")  # LCM stays in its Python environment
  install(TARGETS ${name} RUNTIME DESTINATION ${CMAKE_INSTALL_BINDIR})
  add_dependencies(programs ${name})
endfunction()

# stance_add_test(NAME SOURCES ... DEPENDS ... [LABELS ...]): a Catch2 binary; ctest runs it as one test.
function(stance_add_test name)
  cmake_parse_arguments(ARG "" "" "SOURCES;DEPENDS;LABELS" ${ARGN})
  add_executable(${name} ${ARG_SOURCES})
  target_include_directories(${name} PRIVATE ${PROJECT_SOURCE_DIR})
  target_link_libraries(${name} PRIVATE ${ARG_DEPENDS} Catch2::Catch2WithMain stance_flags)
  target_compile_definitions(${name} PRIVATE STANCE_SOURCE_DIR="${PROJECT_SOURCE_DIR}")
  add_test(NAME ${name} COMMAND ${name})
  set_tests_properties(${name} PROPERTIES LABELS "${ARG_LABELS}" TIMEOUT 600
    ENVIRONMENT "TSAN_OPTIONS=suppressions=${PROJECT_SOURCE_DIR}/tests/tsan.supp history_size=4;UBSAN_OPTIONS=print_stacktrace=1")
endfunction()
