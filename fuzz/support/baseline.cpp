#include <hwy/targets.h>

#include <cstdlib>

/// With FUZZ_BASELINE set, SIMD code runs in its baseline alone: llvm-cov does not see the copies
/// for other instruction sets, for which Highway includes a file again.
extern "C" int LLVMFuzzerInitialize(int*, char***) {
  if (std::getenv("FUZZ_BASELINE") != nullptr) hwy::SetSupportedTargetsForTest(HWY_STATIC_TARGET);
  return 0;
}
