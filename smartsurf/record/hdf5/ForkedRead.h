// Tries an action in a child process first. Internal to this module.
//
// HDF5 1.10 does not check everything that it reads: a damaged file can make it access memory out of bounds.
// A recording of unknown origin is therefore opened by a child process first.
#pragma once

#include <functional>

namespace smartsurf::record {

// Whether the action comes to an end, by returning or throwing, within a minute and without a crash. The
// action runs in a child: nothing that it changes is seen here. True also when no child could be had.
bool completes_in_child(const std::function<void()>& action);

}  // namespace smartsurf::record
