# terrace_library(NAME SOURCES a.cc b.cc [DEPS ...public] [PRIVATE_DEPS ...])
# One folder, one target terrace::NAME, one namespace. engine/common to engine/dem share the namespace terrace::dem.
function(terrace_library name)
  cmake_parse_arguments(ARG "" "" "SOURCES;DEPS;PRIVATE_DEPS" ${ARGN})
  add_library(terrace_${name} STATIC ${ARG_SOURCES})
  # Header-only libraries in sources: programs that link an installed library do not need them.
  list(TRANSFORM ARG_PRIVATE_DEPS REPLACE "^(Boost::headers|nlohmann_json::nlohmann_json)$" "$<BUILD_INTERFACE:\\1>")
  add_library(terrace::${name} ALIAS terrace_${name})
  target_link_libraries(terrace_${name} PUBLIC terrace_options ${ARG_DEPS} PRIVATE ${ARG_PRIVATE_DEPS})
endfunction()

# terrace_vectorized(SOURCE...): sources with loops over samples. g++ 12 makes vectors of loops of unknown length from -O3 on only.
function(terrace_vectorized)
  set_source_files_properties(${ARGN} PROPERTIES COMPILE_OPTIONS $<$<CONFIG:Release>:-O3>)
endfunction()

# terrace_test(NAME SOURCES a_test.cc [DEPS ...] [LABELS ...] [TIMEOUT seconds] [SHARDS n]) One GoogleTest binary, one
# ctest entry. With SHARDS its tests are distributed over n entries that can run in parallel. Its sources are compiled
# together (CMake's unity build), so file-local names must differ between them. TIMEOUT is for tests that may need longer
# than the limit of tools/run_tests.py, which ends tests that hang.
function(terrace_test name)
  cmake_parse_arguments(ARG "" "TIMEOUT;SHARDS" "SOURCES;DEPS;LABELS" ${ARGN})
  if(ARG_TIMEOUT)
    set(timeout TIMEOUT ${ARG_TIMEOUT})
  endif()
  add_executable(${name} ${ARG_SOURCES})
  set_target_properties(${name} PROPERTIES UNITY_BUILD ON UNITY_BUILD_BATCH_SIZE 24)
  target_link_libraries(${name} PRIVATE terrace_options ${ARG_DEPS} terrace_source_dir GTest::gtest GTest::gtest_main Threads::Threads)
  if(NOT ARG_SHARDS)
    add_test(NAME ${name} COMMAND ${name})
    set_tests_properties(${name} PROPERTIES ${timeout} LABELS "${ARG_LABELS}")
    return()
  endif()
  foreach(shard RANGE 1 ${ARG_SHARDS})
    math(EXPR index "${shard} - 1")
    add_test(NAME ${name}_${shard} COMMAND ${name})
    set_tests_properties(${name}_${shard} PROPERTIES ${timeout} LABELS "${ARG_LABELS}"
      ENVIRONMENT "GTEST_TOTAL_SHARDS=${ARG_SHARDS};GTEST_SHARD_INDEX=${index}")
  endforeach()
endfunction()

# terrace_binary_test(NAME SCRIPT.py): a Python test of the built program. The script gets the binary and the source
# directory. It exits with 77 if it cannot run here.
function(terrace_binary_test name script)
  find_package(Python3 REQUIRED COMPONENTS Interpreter)
  add_test(NAME ${name}
    COMMAND Python3::Interpreter "${CMAKE_CURRENT_SOURCE_DIR}/${script}" "$<TARGET_FILE:terrace>" "${PROJECT_SOURCE_DIR}")
  set_tests_properties(${name} PROPERTIES LABELS e2e SKIP_RETURN_CODE 77)
endfunction()
