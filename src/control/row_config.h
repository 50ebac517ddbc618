#pragma once

#include "ist_proximity/control/constraint_rows.h"

namespace ist {

/// Whether config_errors() are none; allocates nothing.
bool is_usable(const RowConfig& config);

}  // namespace ist
