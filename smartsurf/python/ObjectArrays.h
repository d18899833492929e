#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <utility>
#include <vector>

#include "smartsurf/python/Arrays.h"
#include "smartsurf/scene/Snapshot.h"

namespace smartsurf::python {

// Views of the object states of the latest tick. An array that the caller holds stays valid: it follows the
// simulation while the number of objects does not change.
class ObjectArrays {
 public:
  void update(const scene::Snapshot& snapshot) {
    if (!requested_) return;
    if (id_.size() != std::ssize(snapshot.id)) allocate(snapshot.object_count());
    std::ranges::copy(snapshot.id, id_.mutable_data());
    copy(snapshot.position, position_);
    copy(snapshot.orientation, orientation_);
    copy(snapshot.velocity, velocity_);
    copy(snapshot.angular_velocity, angular_velocity_);
  }
  py::dict get(const scene::Snapshot& snapshot) {
    if (!std::exchange(requested_, true)) allocate(snapshot.object_count());
    update(snapshot);
    using namespace py::literals;
    return py::dict("id"_a = id_, "position"_a = position_, "orientation"_a = orientation_,
                    "velocity"_a = velocity_, "angular_velocity"_a = angular_velocity_);
  }

 private:
  void allocate(std::size_t count) {
    const auto n = static_cast<py::ssize_t>(count);
    id_ = Array<std::uint32_t>(std::vector{n});  // from a number, pybind11 makes an array without a stride
    const auto make = [n](py::ssize_t width) { return Array<float>({n, width}); };
    position_ = make(3);
    orientation_ = make(4);
    velocity_ = make(3);
    angular_velocity_ = make(3);
  }
  template <std::size_t size>
  static void copy(const std::vector<std::array<float, size>>& from, Array<float>& to) {
    std::memcpy(to.mutable_data(), from.data(), from.size() * sizeof from[0]);
  }

  bool requested_ = false;
  Array<std::uint32_t> id_{py::ssize_t{0}};
  Array<float> position_, orientation_, velocity_, angular_velocity_;
};

}  // namespace smartsurf::python
