# Warnings, sanitizers and the flags that make results equal on every machine.
set(CMAKE_CXX_STANDARD 20)
set(CMAKE_CXX_STANDARD_REQUIRED ON)
set(CMAKE_CXX_EXTENSIONS OFF)
set(CMAKE_EXPORT_COMPILE_COMMANDS ON)

if(NOT CMAKE_BUILD_TYPE)
  set(CMAKE_BUILD_TYPE Release CACHE STRING "" FORCE)
endif()

find_program(TERRACE_CCACHE ccache)
if(TERRACE_CCACHE)
  set(CMAKE_CXX_COMPILER_LAUNCHER "${TERRACE_CCACHE}")
endif()

set(TERRACE_SANITIZER "" CACHE STRING "address or thread: build everything under that sanitizer (clang-14)")
set_property(CACHE TERRACE_SANITIZER PROPERTY STRINGS "" address thread)

add_library(terrace_options INTERFACE)
target_compile_options(terrace_options INTERFACE
  "$<BUILD_INTERFACE:-Wall;-Wextra;-Wpedantic;-Wshadow;-Wconversion;-Wno-sign-conversion;-Werror=return-type>"
  # Otherwise GCC fuses a*b+c into one rounding on processors that can, and bytes differ between machines. Also for
  # programs that use the library: inline functions of its headers are linked once.
  -ffp-contract=off
  # In a unity build, file-local names of one source are visible in the next. Builds of single sources report shadowed
  # names.
  $<$<BOOL:$<TARGET_PROPERTY:UNITY_BUILD>>:-Wno-shadow>
  $<$<AND:$<BOOL:$<TARGET_PROPERTY:UNITY_BUILD>>,$<CXX_COMPILER_ID:GNU>>:-Wno-subobject-linkage>)
target_compile_features(terrace_options INTERFACE cxx_std_20)
target_include_directories(terrace_options INTERFACE "$<BUILD_INTERFACE:${PROJECT_SOURCE_DIR}>" "$<INSTALL_INTERFACE:include/terrace>")

if(CMAKE_CXX_COMPILER_ID STREQUAL "Clang")
  # As with g++ 12, Highway's fallback is HWY_SCALAR. Its emulation of vectors takes clang-14 two minutes under sanitizers.
  add_compile_definitions(HWY_BROKEN_EMU128=1)
endif()
# Sources that use Highway are compiled once for each instruction set. SSSE3 is the best one only of processors from 2006
# to 2008, which run the scalar code instead. Sanitizers do without SSE4 too: AVX2 is the same code with wider vectors.
add_compile_definitions("HWY_DISABLED_TARGETS=$<IF:$<BOOL:${TERRACE_SANITIZER}>,(HWY_SSSE3|HWY_SSE4),HWY_SSSE3>")
if(TERRACE_SANITIZER STREQUAL "address")
  # clang-14 reports Asio's coroutine frames under -fsanitize=function.
  add_compile_options(-fsanitize=address,undefined -fno-sanitize=function -fno-sanitize-recover=all -fno-omit-frame-pointer -g1)
  add_link_options(-fsanitize=address,undefined)
elseif(TERRACE_SANITIZER STREQUAL "thread")
  add_compile_options(-fsanitize=thread -fno-omit-frame-pointer -g1)
  add_link_options(-fsanitize=thread)
endif()

# For folders with loops over samples, nodes and triangles. The presets of the sanitizers compile the rest with -O0: it takes
# half the time then, and its tests take as long.
function(terrace_optimize_under_sanitizers)
  if(TERRACE_SANITIZER)
    add_compile_options($<$<CONFIG:Debug>:-O1>)
  endif()
endfunction()

option(TERRACE_COVERAGE "Count the lines that run (clang-14; tools/run_coverage.py)" OFF)
if(TERRACE_COVERAGE)
  add_compile_options(-fprofile-instr-generate -fcoverage-mapping)
  add_link_options(-fprofile-instr-generate)
endif()

option(TERRACE_FUZZ "Build the fuzz targets of tests/fuzz (clang-14), best with TERRACE_SANITIZER=address" OFF)
if(TERRACE_FUZZ)
  if(NOT CMAKE_CXX_COMPILER_ID STREQUAL "Clang")
    message(FATAL_ERROR "TERRACE_FUZZ needs libFuzzer: cmake --preset fuzz, or -DCMAKE_CXX_COMPILER=clang++-14")
  endif()
  add_compile_options(-fsanitize=fuzzer-no-link)
endif()
