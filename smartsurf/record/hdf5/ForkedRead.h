// Tries an action in a child process first. Internal to this module.
//
// HDF5 1.10 does not check all that it reads: a damaged file may make it read and write outside its memory. A
// recording that comes from elsewhere is therefore opened by a child before this process opens it.
#pragma once

#include <functional>

namespace smartsurf::record {

// Whether the action comes to an end, by returning or throwing, within a minute and without a crash. The
// action runs in a child: nothing that it changes is seen here. True also when no child could be had.
bool completes_in_child(const std::function<void()>& action);

}  // namespace smartsurf::record
