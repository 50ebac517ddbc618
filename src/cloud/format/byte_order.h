#pragma once

namespace ist {

#if defined(__BYTE_ORDER__) && __BYTE_ORDER__ == __ORDER_BIG_ENDIAN__
constexpr bool kMachineIsBigEndian = true;
#else
constexpr bool kMachineIsBigEndian = false;
#endif

}  // namespace ist
