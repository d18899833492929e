#include "common/process/SharedPlanes.h"

#include <sys/mman.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <string_view>
#include <system_error>

namespace common {
namespace {

constexpr std::uint64_t kMagic = 0x31736e616c70ULL;  // "plans1"

struct Header {
  std::uint64_t magic = 0;
  std::uint32_t count = 0, rows = 0, columns = 0, unused = 0;
  std::array<std::array<char, SharedPlanes::kMaxNameLength + 1>, SharedPlanes::kMaxPlanes> names{};
};

bool write_all(int descriptor, const void* from, std::size_t bytes, std::size_t at) {
  return ::pwrite(descriptor, from, bytes, static_cast<off_t>(at)) == static_cast<ssize_t>(bytes);
}

// Recordings use a name as that of a dataset, and pictures print it.
bool is_plane_name(std::string_view name) {
  return !name.empty() && name != "." && name != ".." &&
         std::ranges::all_of(name, [](char c) { return c > ' ' && c <= '~' && c != '/'; });
}

}  // namespace

// The controller inherits the descriptor: it is not closed on exec.
SharedPlanes::SharedPlanes() : descriptor_(::memfd_create("planes", 0)) {
  if (descriptor_ < 0) throw std::system_error(errno, std::generic_category(), "memfd_create");
}

SharedPlanes::~SharedPlanes() { ::close(descriptor_); }

std::optional<PlaneNames> SharedPlanes::names(std::uint32_t rows, std::uint32_t columns) const {
  Header header;
  if (::pread(descriptor_, &header, sizeof header, 0) != static_cast<ssize_t>(sizeof header) ||
      header.magic != kMagic || header.count > kMaxPlanes || header.rows != rows || header.columns != columns)
    return std::nullopt;
  PlaneNames planes{{}, rows, columns};
  for (std::uint32_t i = 0; i < header.count; ++i) {
    const auto& name = header.names.at(i);
    std::string text(name.begin(), std::find(name.begin(), name.end(), '\0'));
    if (!is_plane_name(text) || std::ranges::find(planes.names, text) != planes.names.end())
      return std::nullopt;
    planes.names.push_back(std::move(text));
  }
  return planes;
}

bool SharedPlanes::read(std::span<float> values) const {
  return ::pread(descriptor_, values.data(), values.size_bytes(), sizeof(Header)) ==
         static_cast<ssize_t>(values.size_bytes());
}

bool SharedPlanes::describe(int descriptor, const PlaneNames& planes) {
  Header header;
  if (planes.names.size() > kMaxPlanes) return false;
  header.magic = kMagic;
  header.count = static_cast<std::uint32_t>(planes.names.size());
  header.rows = planes.rows;
  header.columns = planes.columns;
  for (std::size_t i = 0; i < planes.names.size(); ++i)
    std::copy_n(planes.names[i].begin(), std::min(planes.names[i].size(), kMaxNameLength),
                header.names.at(i).begin());
  return write_all(descriptor, &header, sizeof header, 0);
}

bool SharedPlanes::write(int descriptor, std::size_t first, std::span<const float> values) {
  return write_all(descriptor, values.data(), values.size_bytes(), sizeof(Header) + first * sizeof(float));
}

}  // namespace common
