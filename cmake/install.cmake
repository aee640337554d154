# Install and export: find_package(stance) gives stance::force_qp and its siblings.
include(CMakePackageConfigHelpers)
get_property(libraries GLOBAL PROPERTY STANCE_LIBRARIES)
install(TARGETS ${libraries} EXPORT stanceTargets ARCHIVE DESTINATION ${CMAKE_INSTALL_LIBDIR})
