# Finds every third-party library. They are Debian 12 packages; tools/install_deps.sh installs them.
find_package(Threads REQUIRED)
find_package(PkgConfig REQUIRED)

# Boost: GDAL's headers depend on Debian's default 1.74, which lacks features that the server needs, and 1.81 cannot be
# installed beside it. So tools/install_deps.sh unpacks the 1.81 headers into .deps/boost.
set(TERRACE_BOOST_ROOT "${PROJECT_SOURCE_DIR}/.deps/boost/usr" CACHE PATH "Prefix that holds the Boost 1.81 headers")
if(EXISTS "${TERRACE_BOOST_ROOT}")
  find_package(Boost 1.81 CONFIG REQUIRED COMPONENTS headers PATHS "${TERRACE_BOOST_ROOT}" NO_DEFAULT_PATH)
else()
  find_package(Boost 1.81 CONFIG REQUIRED COMPONENTS headers)
endif()

# Number of coroutine frames that a thread keeps for reuse. A request has more than Asio's default of two at a time, and
# every further one would call malloc.
target_compile_definitions(Boost::headers INTERFACE BOOST_ASIO_RECYCLING_ALLOCATOR_CACHE_SIZE=8)

find_package(tl-expected REQUIRED)
find_package(fmt REQUIRED)
find_package(spdlog REQUIRED)
find_package(nlohmann_json REQUIRED)
find_package(CLI11 REQUIRED)
find_package(draco REQUIRED)
find_package(meshoptimizer REQUIRED)
find_package(GDAL REQUIRED)
find_package(PROJ REQUIRED CONFIG)
find_package(prometheus-cpp REQUIRED)
find_package(OpenSSL 3.0 REQUIRED)
pkg_check_modules(LIBDEFLATE REQUIRED IMPORTED_TARGET libdeflate)
pkg_check_modules(BROTLIENC REQUIRED IMPORTED_TARGET libbrotlienc)
pkg_check_modules(ZSTD REQUIRED IMPORTED_TARGET libzstd)
pkg_check_modules(HWY REQUIRED IMPORTED_TARGET libhwy libhwy-contrib)
pkg_check_modules(ROCKSDB REQUIRED IMPORTED_TARGET rocksdb)
pkg_check_modules(GEOS REQUIRED IMPORTED_TARGET geos)
pkg_check_modules(HIREDIS REQUIRED IMPORTED_TARGET hiredis)
pkg_check_modules(XXHASH REQUIRED IMPORTED_TARGET libxxhash)
pkg_check_modules(SYSTEMD REQUIRED IMPORTED_TARGET libsystemd)
find_package(JPEG REQUIRED)
find_package(ZLIB REQUIRED)
pkg_check_modules(WEBP REQUIRED IMPORTED_TARGET libwebp)
find_path(TERRACE_PROTOZERO_INCLUDE protozero/pbf_writer.hpp REQUIRED)  # headers alone
if(TERRACE_BUILD_TESTS)
  find_package(GTest REQUIRED)
  find_package(benchmark REQUIRED)
  pkg_check_modules(BROTLIDEC REQUIRED IMPORTED_TARGET libbrotlidec)
endif()
