// Named 2-D arrays of floats that a child process shows its parent. They lie in a file without a name, whose
// descriptor the child inherits, so nothing stays behind. Neither side waits: the caller's protocol says when
// the arrays are complete.
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <vector>

namespace common {

struct PlaneNames {
  std::vector<std::string> names;
  std::uint32_t rows = 0, columns = 0;  // of each array
};

class SharedPlanes {
 public:
  static constexpr std::size_t kMaxPlanes = 256, kMaxNameLength = 63;

  // The parent's side. Throws std::system_error if the system has no more descriptors or memory.
  SharedPlanes();
  ~SharedPlanes();
  SharedPlanes(const SharedPlanes&) = delete;
  SharedPlanes& operator=(const SharedPlanes&) = delete;
  int descriptor() const { return descriptor_; }

  // The child's names: distinct, of printable ASCII without spaces and '/'. nullopt until the child has
  // described its arrays, or if their form is not rows × columns.
  std::optional<PlaneNames> names(std::uint32_t rows, std::uint32_t columns) const;
  // Reads all arrays, one after the other. False if the file is shorter.
  bool read(std::span<float> values) const;

  // The child's side, with the inherited descriptor. False if it cannot be written.
  static bool describe(int descriptor, const PlaneNames& planes);
  // Writes cells [first, first + values.size()) of all arrays, one after the other.
  static bool write(int descriptor, std::size_t first, std::span<const float> values);

 private:
  int descriptor_;
};

}  // namespace common
