#pragma once

#include <gtest/gtest.h>
#include <hwy/highway.h>
#include <hwy/targets.h>

#include <cstdint>

namespace ist::test {

/// Selects the instruction set from now on; 0: the best one of the processor.
inline void choose_instruction_sets(std::int64_t targets) {
  hwy::SetSupportedTargetsForTest(targets);
  hwy::GetChosenTarget().Update(hwy::SupportedTargets());
}

/// All instruction sets that the processor supports.
template <typename Test>
void for_each_instruction_set(const Test& test) {
  choose_instruction_sets(0);
  for (std::int64_t left = hwy::SupportedTargets() & HWY_TARGETS; left != 0; left &= left - 1) {
    choose_instruction_sets(left & -left);
    SCOPED_TRACE(hwy::TargetName(left & -left));
    test();
  }
  choose_instruction_sets(0);
}

}  // namespace ist::test
