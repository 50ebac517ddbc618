# Language, warnings, sanitizers.

set(CMAKE_CXX_STANDARD 17)
set(CMAKE_CXX_STANDARD_REQUIRED ON)
set(CMAKE_CXX_EXTENSIONS OFF)
set(CMAKE_POSITION_INDEPENDENT_CODE ON)
set(CMAKE_EXPORT_COMPILE_COMMANDS ON)

if(NOT CMAKE_BUILD_TYPE AND NOT CMAKE_CONFIGURATION_TYPES)
  set(CMAKE_BUILD_TYPE Release CACHE STRING "Build type" FORCE)
endif()

# -ffast-math is out: NaN and infinity carry meaning here. -march=native is out: Highway picks the
# instruction set at run time, and Eigen types in the interface would change their alignment.
# a*b+c is one operation where the code says so (MulAdd), nowhere else: results must not depend on what
# the compiler makes of it. GCC contracts in C++'s ISO mode, too.
add_compile_options(-ffp-contract=off)
add_compile_options(-Wall -Wextra -Wpedantic -Wshadow -Wnon-virtual-dtor -Woverloaded-virtual -Wvla)
if(IST_PROXIMITY_WERROR)
  add_compile_options(-Werror)
endif()

# The compiler collects no garbage before it has taken this many kilobytes, which few sources do.
if(CMAKE_CXX_COMPILER_ID STREQUAL "GNU")
  add_compile_options(--param=ggc-min-heapsize=1000000)
endif()

# No copy of the SIMD code for SSSE3: processors without SSE4 are of 2007.
if(NOT IST_PROXIMITY_SANITIZE AND NOT IST_PROXIMITY_FUZZ)
  add_compile_definitions(HWY_DISABLED_TARGETS=HWY_SSSE3)
endif()

if(IST_PROXIMITY_SANITIZE)
  add_compile_options(
    -fsanitize=${IST_PROXIMITY_SANITIZE} -fno-sanitize-recover=all -fno-omit-frame-pointer)
  # ASan finds what `null` and `object-size` look for, and they take half of the compiler's time.
  add_compile_options(-fno-sanitize=null,object-size,vptr)
  add_compile_definitions(_GLIBCXX_ASSERTIONS)
  # Fewer copies of the SIMD code: the baseline, AVX2 and AVX-512 say it all.
  add_compile_definitions("HWY_DISABLED_TARGETS=(HWY_SSSE3|HWY_SSE4|HWY_AVX3_DL)")
  # Not add_link_options(): catkin's own targets are linked without it.
  string(APPEND CMAKE_EXE_LINKER_FLAGS " -fsanitize=${IST_PROXIMITY_SANITIZE}")
  string(APPEND CMAKE_SHARED_LINKER_FLAGS " -fsanitize=${IST_PROXIMITY_SANITIZE}")
endif()

# libFuzzer's build (scripts/fuzz): every source counts what it runs, for the search and for llvm-cov.
if(IST_PROXIMITY_FUZZ)
  if(NOT CMAKE_CXX_COMPILER_ID STREQUAL "Clang")
    message(FATAL_ERROR "IST_PROXIMITY_FUZZ needs clang, for libFuzzer: "
      "-DCMAKE_CXX_COMPILER=clang++, or cmake --preset fuzz")
  endif()
  set(fuzz_sanitizers address,undefined)
  add_compile_options(
    -fsanitize=fuzzer-no-link,${fuzz_sanitizers} -fno-sanitize-recover=all
    -fno-sanitize=null,object-size,vptr -fno-omit-frame-pointer
    -fprofile-instr-generate -fcoverage-mapping)
  # One copy of the SIMD code beside the baseline; tests compare the instruction sets.
  add_compile_definitions(_GLIBCXX_ASSERTIONS
    "HWY_DISABLED_TARGETS=(HWY_SSSE3|HWY_SSE4|HWY_AVX3|HWY_AVX3_DL)")
  string(APPEND CMAKE_EXE_LINKER_FLAGS " -fsanitize=${fuzz_sanitizers} -fprofile-instr-generate")
  string(APPEND CMAKE_SHARED_LINKER_FLAGS " -fsanitize=${fuzz_sanitizers} -fprofile-instr-generate")
endif()
