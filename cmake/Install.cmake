# Installs the tiler library for find_package(terrace): static libraries, the headers of its interface, and the package
# files. Component "development"; `cmake --install` without a component leaves it out, so packages of the server do not
# contain it.
include(CMakePackageConfigHelpers)

# terrace_reached_headers(RESULT HEADER...): these headers and those that they include, relative to the tree.
function(terrace_reached_headers result)
  set(reached "")
  set(open ${ARGN})
  while(open)
    list(POP_FRONT open header)
    if(header IN_LIST reached)
      continue()
    endif()
    list(APPEND reached "${header}")
    file(STRINGS "${PROJECT_SOURCE_DIR}/${header}" lines REGEX "^#include \"")
    foreach(line IN LISTS lines)
      string(REGEX REPLACE "^#include \"([^\"]+)\".*" "\\1" included "${line}")
      list(APPEND open "${included}")
    endforeach()
  endwhile()
  set(${result} ${reached} PARENT_SCOPE)
endfunction()

# Every library below the tiler, in the order of includes.
set(terrace_installed core geo tin dem_common dem_gdal dem_crs dem_raster dem_statistics dem_sources dem_mosaic dem_export dem_sight
  dem_bound dem_edits dem_image dem proto tiler)
set(terrace_targets terrace_options)
set_target_properties(terrace_options PROPERTIES EXPORT_NAME options)
foreach(name IN LISTS terrace_installed)
  set_target_properties(terrace_${name} PROPERTIES EXPORT_NAME ${name})
  list(APPEND terrace_targets terrace_${name})
endforeach()
install(TARGETS ${terrace_targets} EXPORT terrace_targets
  ARCHIVE DESTINATION lib/terrace COMPONENT development EXCLUDE_FROM_ALL)
install(EXPORT terrace_targets NAMESPACE terrace:: FILE terraceTargets.cmake
  DESTINATION lib/cmake/terrace COMPONENT development EXCLUDE_FROM_ALL)

file(GLOB terrace_interface RELATIVE "${PROJECT_SOURCE_DIR}"
  "${PROJECT_SOURCE_DIR}/tiler/*.h" "${PROJECT_SOURCE_DIR}/engine/dem/*.h" "${PROJECT_SOURCE_DIR}/engine/geo/*.h")
terrace_reached_headers(terrace_headers ${terrace_interface})
foreach(header IN LISTS terrace_headers)
  cmake_path(GET header PARENT_PATH folder)
  install(FILES "${PROJECT_SOURCE_DIR}/${header}" DESTINATION "include/terrace/${folder}"
    COMPONENT development EXCLUDE_FROM_ALL)
endforeach()

configure_package_config_file("${CMAKE_CURRENT_LIST_DIR}/terraceConfig.cmake.in" "${CMAKE_BINARY_DIR}/terraceConfig.cmake"
  INSTALL_DESTINATION lib/cmake/terrace NO_SET_AND_CHECK_MACRO)
# Headers may change with a minor version.
write_basic_package_version_file("${CMAKE_BINARY_DIR}/terraceConfigVersion.cmake" COMPATIBILITY SameMinorVersion)
install(FILES "${CMAKE_BINARY_DIR}/terraceConfig.cmake" "${CMAKE_BINARY_DIR}/terraceConfigVersion.cmake"
  DESTINATION lib/cmake/terrace COMPONENT development EXCLUDE_FROM_ALL)
