# Installs the tiler library for find_package(terrace): static libraries, the headers of its interface with those that
# they include, and the package files. Component "development"; `cmake --install` without a component leaves it out, so
# packages of the server do not contain it.
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

# terrace_linked_targets(RESULT TARGET): the target, and those of terrace that it links, directly or through others.
function(terrace_linked_targets result target)
  set(linked "")
  set(open ${target})
  while(open)
    list(POP_FRONT open name)
    if(name IN_LIST linked)
      continue()
    endif()
    list(APPEND linked ${name})
    get_target_property(libraries ${name} LINK_LIBRARIES)
    list(FILTER libraries INCLUDE REGEX "^terrace::")
    list(TRANSFORM libraries REPLACE "^terrace::" "terrace_")
    list(APPEND open ${libraries})
  endwhile()
  set(${result} ${linked} PARENT_SCOPE)
endfunction()

terrace_linked_targets(terrace_targets terrace_tiler)
list(APPEND terrace_targets terrace_options)
foreach(target IN LISTS terrace_targets)
  string(REGEX REPLACE "^terrace_" "" name "${target}")
  set_target_properties(${target} PROPERTIES EXPORT_NAME ${name})
endforeach()
install(TARGETS ${terrace_targets} EXPORT terrace_targets
  ARCHIVE DESTINATION lib/terrace COMPONENT development EXCLUDE_FROM_ALL)
install(EXPORT terrace_targets NAMESPACE terrace:: FILE terraceTargets.cmake
  DESTINATION lib/cmake/terrace COMPONENT development EXCLUDE_FROM_ALL)

# The headers of docs/embedding.md.
terrace_reached_headers(terrace_headers engine/dem/elevation_model.h engine/geo/error_ladder.h
  engine/common/averages_budget.h engine/statistics/cache_folder.h tiler/store/tile_tiers.h tiler/tile_pipeline.h)
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
