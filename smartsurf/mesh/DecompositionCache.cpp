#include "smartsurf/mesh/DecompositionCache.h"

#include <fmt/format.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstdlib>
#include <cstring>
#include <string>
#include <string_view>
#include <system_error>
#include <utility>

#include "common/files/AtomicFile.h"
#include "common/files/ReadFile.h"
#include "common/hash/Fnv.h"
#include "smartsurf/mesh/ByteString.h"

namespace smartsurf::mesh {
namespace {

namespace fs = std::filesystem;

constexpr std::string_view kEnding = ".parts";
constexpr std::size_t kMinTriangles = 64;  // smaller meshes take less time than a file

// Takes values from the front of the bytes; false if there are fewer.
template <typename T>
bool take(std::string_view& bytes, T* values, std::size_t count) {
  if (count > bytes.size() / sizeof(T)) return false;
  std::memcpy(static_cast<void*>(values), bytes.data(), count * sizeof(T));
  bytes.remove_prefix(count * sizeof(T));
  return true;
}

// All that a decomposition depends on. A file holds it whole, so that meshes of equal hashes are told apart.
std::string key_of(const TriangleMesh& mesh, const DecompositionLimits& limits) {
  const std::uint32_t numbers[] = {kDecompositionVersion, static_cast<std::uint32_t>(limits.max_parts),
                                   static_cast<std::uint32_t>(limits.max_hollow_parts)};
  const std::uint64_t counts[] = {mesh.points.size(), mesh.triangles.size()};
  std::string key = "smartsurf-parts\n";
  append(key, numbers, 3);
  append(key, &limits.max_excess, 1);
  append(key, counts, 2);
  append(key, mesh.points.data(), mesh.points.size());
  append(key, mesh.triangles.data(), mesh.triangles.size());
  return key;
}

bool is_own_folder(const fs::path& folder) {
  struct stat status {};
  return ::lstat(folder.c_str(), &status) == 0 && S_ISDIR(status.st_mode) && status.st_uid == ::geteuid() &&
         (status.st_mode & (S_IWGRP | S_IWOTH)) == 0;
}

}  // namespace

DecompositionCache::DecompositionCache(fs::path folder, std::uintmax_t max_bytes)
    : folder_(std::move(folder)), max_bytes_(max_bytes) {}

DecompositionCache::Parts DecompositionCache::decompose(const TriangleMesh& mesh,
                                                        const DecompositionLimits& limits) const {
  if (folder_.empty() || mesh.triangles.size() < kMinTriangles) return decompose_convex(mesh, limits);
  const std::string key = key_of(mesh, limits);
  const fs::path file = folder_ / fmt::format("{:016x}{}", common::fnv1a(key), kEnding);
  if (std::optional<Parts> known = read(file, key, mesh, limits)) return std::move(*known);
  Parts parts = decompose_convex(mesh, limits);
  write(file, key, parts);
  return parts;
}

// A file may be torn, or written by whoever has become this user: its parts are believed if the checksum is
// right and each point lies within the mesh. What follows from them is checked as for computed parts.
std::optional<DecompositionCache::Parts> DecompositionCache::read(const fs::path& file,
                                                                  const std::string& key,
                                                                  const TriangleMesh& mesh,
                                                                  const DecompositionLimits& limits) const {
  std::string content;
  if (!is_own_folder(folder_) || common::read_file(file, max_bytes_ / 4, content)) return std::nullopt;
  std::string_view bytes = content;
  std::uint64_t checksum = 0;
  if (!bytes.starts_with(key) || bytes.size() < key.size() + sizeof checksum) return std::nullopt;
  std::memcpy(&checksum, bytes.data() + bytes.size() - sizeof checksum, sizeof checksum);
  bytes.remove_suffix(sizeof checksum);
  if (checksum != common::fnv1a(bytes)) return std::nullopt;
  bytes.remove_prefix(key.size());

  const auto max_parts = static_cast<std::uint32_t>(std::max(limits.max_parts, limits.max_hollow_parts));
  std::uint32_t count = 0;
  if (!take(bytes, &count, 1) || count == 0 || count > max_parts) return std::nullopt;
  std::vector<std::uint32_t> sizes(count);
  if (!take(bytes, sizes.data(), count)) return std::nullopt;
  Eigen::Vector3d low = mesh.points.front(), high = low;
  for (const Eigen::Vector3d& point : mesh.points) {
    low = low.cwiseMin(point);
    high = high.cwiseMax(point);
  }
  const Eigen::Vector3d slack = Eigen::Vector3d::Constant(1e-6 * (high - low).norm());
  Parts parts;
  for (const std::uint32_t size : sizes) {
    if (size == 0 || size > bytes.size() / sizeof(Eigen::Vector3d)) return std::nullopt;
    std::vector<Eigen::Vector3d> part(size);
    take(bytes, part.data(), size);
    for (const Eigen::Vector3d& point : part)
      if (!((point - low + slack).minCoeff() >= 0.0 && (high - point + slack).minCoeff() >= 0.0))
        return std::nullopt;  // not finite, too
    parts.push_back(std::move(part));
  }
  if (!bytes.empty()) return std::nullopt;
  return parts;
}

void DecompositionCache::write(const fs::path& file, const std::string& key, const Parts& parts) const {
  std::string bytes = key;
  const auto count = static_cast<std::uint32_t>(parts.size());
  append(bytes, &count, 1);
  for (const auto& part : parts) {
    const auto size = static_cast<std::uint32_t>(part.size());
    append(bytes, &size, 1);
  }
  for (const auto& part : parts) append(bytes, part.data(), part.size());
  const std::uint64_t checksum = common::fnv1a(bytes);
  append(bytes, &checksum, 1);
  if (bytes.size() > max_bytes_ / 4 || !create_decomposition_folder(folder_) ||
      common::replace_file(file, bytes))
    return;

  // Only files of this cache, and what a killed process has left of one.
  struct Kept {
    fs::file_time_type written;
    fs::path file;
    std::uintmax_t bytes;
  };
  std::vector<Kept> all;
  std::uintmax_t total = 0;
  std::error_code error;
  for (fs::directory_iterator entry(folder_, error), end; !error && entry != end; entry.increment(error)) {
    std::error_code gone;
    if (!entry->is_regular_file(gone) || entry->path().filename().string().find(kEnding) == std::string::npos)
      continue;
    Kept kept{entry->last_write_time(gone), entry->path(), entry->file_size(gone)};
    if (gone) continue;
    total += kept.bytes;
    all.push_back(std::move(kept));
  }
  std::ranges::sort(all, {}, &Kept::written);
  for (const Kept& kept : all) {
    if (total <= max_bytes_) break;
    if (fs::remove(kept.file, error)) total -= kept.bytes;
  }
}

fs::path decomposition_folder() {
  const auto absolute = [](const char* variable) {
    const char* const value = std::getenv(variable);
    return value != nullptr && fs::path(value).is_absolute() ? fs::path(value) : fs::path();
  };
  const char* const chosen = std::getenv("SMARTSURF_MESH_CACHE");
  if (chosen != nullptr && std::string_view(chosen) == "off") return {};
  if (fs::path folder = absolute("SMARTSURF_MESH_CACHE"); !folder.empty()) return folder;
  fs::path folder = absolute("XDG_CACHE_HOME");
  if (const fs::path home = absolute("HOME"); folder.empty() && !home.empty()) folder = home / ".cache";
  return folder.empty() ? folder : folder / "smartsurf" / "meshes";
}

bool create_decomposition_folder(const fs::path& folder) {
  std::error_code error;
  if (!fs::exists(folder, error)) {
    fs::create_directories(folder.parent_path(), error);
    if (::mkdir(folder.c_str(), 0700) != 0 && errno != EEXIST) return false;
  }
  return is_own_folder(folder);
}

}  // namespace smartsurf::mesh
