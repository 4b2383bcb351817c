# Installation: headers, libraries, the program, the small model, and a CMake package, with which
#   find_package(patina REQUIRED)
#   target_link_libraries(my_program PRIVATE patina::patina)
# works in a project of one's own (examples/render_and_fit).
include(GNUInstallDirs)
include(CMakePackageConfigHelpers)

# All of the library under one name.
add_library(patina_all INTERFACE)
target_link_libraries(patina_all INTERFACE patina_pipeline)
set_target_properties(patina_all PROPERTIES EXPORT_NAME patina)

set(patina_libraries base image asset render views masks correspond attention nn diffusion inverse report pipeline)
list(TRANSFORM patina_libraries PREPEND patina_)
foreach(library options torch ${patina_libraries})
  string(REGEX REPLACE "^patina_" "" name "${library}")
  set_target_properties(patina_${name} PROPERTIES EXPORT_NAME ${name})
endforeach()

install(TARGETS patina_all patina_options patina_torch ${patina_libraries} EXPORT patina_targets
  ARCHIVE DESTINATION "${CMAKE_INSTALL_LIBDIR}")
# Component program is what a package holds beside the libraries of others (packaging/).
install(TARGETS patina RUNTIME DESTINATION "${CMAKE_INSTALL_BINDIR}" COMPONENT program)
install(DIRECTORY "${CMAKE_SOURCE_DIR}/src/patina" DESTINATION "${CMAKE_INSTALL_INCLUDEDIR}"
  FILES_MATCHING PATTERN "*.h")
install(DIRECTORY "${CMAKE_SOURCE_DIR}/models/patina-mini" DESTINATION "${CMAKE_INSTALL_DATADIR}/patina/models"
  COMPONENT program)
install(FILES "${CMAKE_SOURCE_DIR}/examples/kettle.glb" DESTINATION "${CMAKE_INSTALL_DATADIR}/patina/examples"
  COMPONENT program)
install(FILES "${CMAKE_SOURCE_DIR}/README.md" "${CMAKE_SOURCE_DIR}/CHANGELOG.md" "${CMAKE_SOURCE_DIR}/LICENSE"
  DESTINATION "${CMAKE_INSTALL_DOCDIR}" COMPONENT program)

# A package brings the libraries of others in lib/patina. A RUNPATH would hold for the program's own libraries and not
# for what those ask for, and would come after LD_LIBRARY_PATH, in which many a shell holds an older libstdc++.
set_target_properties(patina PROPERTIES INSTALL_RPATH "$ORIGIN/../lib/patina")
target_link_options(patina PRIVATE LINKER:--disable-new-dtags)

set(package_folder "${CMAKE_INSTALL_LIBDIR}/cmake/patina")
install(EXPORT patina_targets NAMESPACE patina:: FILE patina-targets.cmake DESTINATION "${package_folder}")
configure_package_config_file("${CMAKE_CURRENT_LIST_DIR}/patina-config.cmake.in"
  "${CMAKE_BINARY_DIR}/patina-config.cmake" INSTALL_DESTINATION "${package_folder}")
# Before 1.0 a minor version may change the interface.
write_basic_package_version_file("${CMAKE_BINARY_DIR}/patina-config-version.cmake" COMPATIBILITY SameMinorVersion)
install(FILES "${CMAKE_BINARY_DIR}/patina-config.cmake" "${CMAKE_BINARY_DIR}/patina-config-version.cmake"
  DESTINATION "${package_folder}")
