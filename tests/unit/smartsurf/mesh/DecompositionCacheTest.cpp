#include "smartsurf/mesh/DecompositionCache.h"

#include <gtest/gtest.h>
#include <unistd.h>

#include <cmath>
#include <cstdlib>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <limits>
#include <random>
#include <string>

#include "smartsurf/mesh/SolidBuilder.h"
#include "tests/unit/common/SanitizedCases.h"
#include "tests/unit/smartsurf/mesh/TestMeshes.h"

namespace smartsurf::mesh {
namespace {

namespace fs = std::filesystem;
using Parts = DecompositionCache::Parts;

constexpr DecompositionLimits kLimits{.max_parts = 6};

// A closed mesh without symmetry.
TriangleMesh drawn_mesh(unsigned seed) {
  std::mt19937 random(seed);
  std::uniform_real_distribution<double> share(0.0, 1.0);
  const double major = 2.0 + share(random), minor = 0.4 + 0.3 * share(random);
  TriangleMesh mesh = torus(major, minor, 8 + seed % 4, 5 + seed % 3);
  for (Eigen::Vector3d& point : mesh.points) point *= 1.0 + 0.02 * share(random);
  return mesh;
}

class DecompositionCacheTest : public testing::Test {
 protected:
  void SetUp() override {
    folder = fs::path(testing::TempDir()) / ("smartsurf-cache-" + std::to_string(getpid()));
    fs::remove_all(folder);
    fs::create_directories(folder);
    fs::permissions(folder, fs::perms::owner_all);
  }
  void TearDown() override {
    fs::remove_all(folder);
    for (const char* variable : {"SMARTSURF_MESH_CACHE", "XDG_CACHE_HOME"}) unsetenv(variable);
  }

  fs::path only_file() const {
    EXPECT_EQ(std::distance(fs::directory_iterator(folder), {}), 1);
    return fs::directory_iterator(folder)->path();
  }
  static std::string content_of(const fs::path& file) {
    std::ifstream in(file, std::ios::binary);
    return {std::istreambuf_iterator<char>(in), {}};
  }
  static void write(const fs::path& file, const std::string& bytes) {
    std::ofstream(file, std::ios::binary) << bytes;
  }
  // With the checksum that fits.
  static std::string sealed(std::string bytes) {
    bytes.resize(bytes.size() - 8);
    std::uint64_t hash = 0xCBF29CE484222325U;
    for (const char c : bytes) hash = (hash ^ static_cast<unsigned char>(c)) * 0x100000001B3U;
    bytes.append(reinterpret_cast<const char*>(&hash), 8);
    return bytes;
  }

  fs::path folder;
};

TEST_F(DecompositionCacheTest, GivesTheSamePartsWithAndWithoutItsFile) {
  constexpr unsigned kSeeds = cases(3U, 1U);
  for (unsigned seed = 1; seed <= kSeeds; ++seed) {
    const TriangleMesh mesh = drawn_mesh(seed);
    const Parts computed = decompose_convex(mesh, kLimits);
    EXPECT_EQ(DecompositionCache(folder).decompose(mesh, kLimits), computed);
    EXPECT_EQ(DecompositionCache(folder).decompose(mesh, kLimits), computed);
    EXPECT_EQ(DecompositionCache("").decompose(mesh, kLimits), computed);
    EXPECT_NE(DecompositionCache(folder).decompose(mesh, {.max_parts = 2}), computed);
  }
  EXPECT_EQ(std::distance(fs::directory_iterator(folder), {}), std::ptrdiff_t{2 * kSeeds});
}

TEST_F(DecompositionCacheTest, ReadsItsFile) {
  const TriangleMesh mesh = drawn_mesh(1);
  Parts parts = DecompositionCache(folder).decompose(mesh, kLimits);
  std::string bytes = content_of(only_file());
  double x = parts.back().back().x() * 0.5;
  std::memcpy(bytes.data() + bytes.size() - 8 - sizeof(Eigen::Vector3d), &x, sizeof x);
  write(only_file(), sealed(bytes));
  parts.back().back().x() = x;
  EXPECT_EQ(DecompositionCache(folder).decompose(mesh, kLimits), parts);
}

TEST_F(DecompositionCacheTest, ComputesAnewWhatIsDamaged) {
  const TriangleMesh mesh = drawn_mesh(2);
  const Parts computed = DecompositionCache(folder).decompose(mesh, kLimits);
  const fs::path file = only_file();
  const std::string whole = content_of(file);
  std::mt19937 random(7);
  for (int round = 0; round < cases(12, 3); ++round) {
    std::string bytes = whole;
    const std::size_t at = random() % bytes.size();
    if (round % 3 == 0)
      bytes.resize(at);
    else if (round % 3 == 1)
      bytes[at] = static_cast<char>(bytes[at] ^ (1 << random() % 8));
    else
      bytes.insert(at, 1 + random() % 64, static_cast<char>(random()));
    write(file, bytes);
    ASSERT_EQ(DecompositionCache(folder).decompose(mesh, kLimits), computed) << round;
    ASSERT_TRUE(content_of(file) == whole) << round;
  }
}

TEST_F(DecompositionCacheTest, BelievesNoSealedNonsense) {
  const TriangleMesh mesh = drawn_mesh(3);
  const Parts computed = DecompositionCache(folder).decompose(mesh, kLimits);
  const fs::path file = only_file();
  const std::string whole = content_of(file);
  std::size_t points = 0;
  for (const auto& part : computed) points += part.size();
  const std::size_t first_point = whole.size() - 8 - points * sizeof(Eigen::Vector3d);
  const std::size_t first_size = first_point - 4 * computed.size(), count = first_size - 4;
  const auto put = [&](std::size_t at, auto value) {
    std::string bytes = whole;
    std::memcpy(bytes.data() + at, &value, sizeof value);
    return sealed(bytes);
  };
  for (const std::string& bytes :
       {put(count, 0U), put(count, 7U), put(count, ~0U), put(first_size, 0U), put(first_size, ~0U),
        put(first_size, static_cast<std::uint32_t>(computed[0].size() + 1)), put(first_point, 100.0),
        put(first_point, std::nan("")), put(first_point, -std::numeric_limits<double>::infinity())}) {
    write(file, bytes);
    EXPECT_EQ(DecompositionCache(folder).decompose(mesh, kLimits), computed);
    EXPECT_TRUE(content_of(file) == whole);
  }
}

TEST_F(DecompositionCacheTest, AnotherMeshWithTheSameHashIsNoMatch) {
  const TriangleMesh mesh = drawn_mesh(4), other = drawn_mesh(5);
  DecompositionCache(folder).decompose(mesh, kLimits);
  const fs::path file = only_file();
  const std::string bytes = content_of(file);
  fs::remove(file);
  const Parts computed = DecompositionCache(folder).decompose(other, kLimits);
  write(only_file(), bytes);
  EXPECT_EQ(DecompositionCache(folder).decompose(other, kLimits), computed);
}

TEST_F(DecompositionCacheTest, TheOldestFilesMakeRoom) {
  std::uintmax_t largest = 0;
  for (unsigned seed = 1; seed <= 6; ++seed) {
    const std::uintmax_t limit = 40000;
    DecompositionCache(folder, limit).decompose(drawn_mesh(seed), kLimits);
    std::uintmax_t total = 0;
    for (const auto& entry : fs::directory_iterator(folder)) total += entry.file_size();
    EXPECT_LE(total, limit);
    largest = std::max(largest, total);
  }
  EXPECT_GT(largest, 20000U);
  write(folder / "notes.txt", std::string(100000, ' '));
  DecompositionCache(folder, 40000).decompose(drawn_mesh(7), kLimits);
  EXPECT_TRUE(fs::exists(folder / "notes.txt"));
}

TEST_F(DecompositionCacheTest, AFolderThatCannotBeCreatedIsNoError) {
  const TriangleMesh mesh = drawn_mesh(6);
  write(folder / "file", "");
  EXPECT_EQ(DecompositionCache(folder / "file/none").decompose(mesh, kLimits),
            decompose_convex(mesh, kLimits));
}

TEST_F(DecompositionCacheTest, TheFolderIsCreatedForTheFirstFile) {
  const fs::path missing = folder / "home/meshes";
  const DecompositionCache cache(missing);
  cache.decompose(torus(2.0, 0.5, 4, 4), kLimits);  // too small to be kept
  EXPECT_FALSE(fs::exists(folder / "home"));
  const Parts computed = cache.decompose(drawn_mesh(6), kLimits);
  EXPECT_EQ(fs::status(missing).permissions(), fs::perms::owner_all);
  EXPECT_EQ(std::distance(fs::directory_iterator(missing), {}), 1);
  EXPECT_EQ(cache.decompose(drawn_mesh(6), kLimits), computed);
}

TEST_F(DecompositionCacheTest, TheUsersFolderIsNamedByTheEnvironment) {
  setenv("XDG_CACHE_HOME", folder.c_str(), 1);
  EXPECT_EQ(decomposition_folder(), folder / "smartsurf/meshes");
  setenv("SMARTSURF_MESH_CACHE", (folder / "own").c_str(), 1);
  EXPECT_EQ(decomposition_folder(), folder / "own");
  setenv("SMARTSURF_MESH_CACHE", "off", 1);
  EXPECT_EQ(decomposition_folder(), "");
  EXPECT_TRUE(fs::is_empty(folder));
}

TEST_F(DecompositionCacheTest, NothingIsKeptWhereOthersWrite) {
  const TriangleMesh mesh = drawn_mesh(6);
  const fs::path own = folder / "own", link = folder / "link";
  const Parts computed = DecompositionCache(own).decompose(mesh, kLimits);
  std::string bytes = content_of(fs::directory_iterator(own)->path());
  double x = computed.back().back().x() * 0.5;
  std::memcpy(bytes.data() + bytes.size() - 8 - sizeof(Eigen::Vector3d), &x, sizeof x);
  write(fs::directory_iterator(own)->path(), sealed(bytes));
  ASSERT_NE(DecompositionCache(own).decompose(mesh, kLimits), computed);
  fs::create_directory_symlink(own, link);
  EXPECT_EQ(DecompositionCache(link).decompose(mesh, kLimits), computed);
  fs::permissions(own, fs::perms::all);
  EXPECT_EQ(DecompositionCache(own).decompose(mesh, kLimits), computed);
}

// Whoever changes the decomposition raises kDecompositionVersion, and then these numbers.
TEST_F(DecompositionCacheTest, TheVersionIsThatOfTheAlgorithm) {
  EXPECT_EQ(kDecompositionVersion, 2U);
  double sum = 0.0;
  std::size_t points = 0, parts = 0;
  for (unsigned seed = 1; seed <= 4; ++seed)
    for (const auto& part : decompose_convex(drawn_mesh(seed), kLimits)) {
      ++parts;
      points += part.size();
      for (const Eigen::Vector3d& point : part) sum += point.cwiseAbs().sum();
    }
  EXPECT_EQ(parts, 24U);
  EXPECT_EQ(points, 810U);
  EXPECT_NEAR(sum, 2818.8048, 1e-3);
  sum = 0.0;
  for (const auto& part : decompose_convex(torus(3.0, 1.0, 100, 40), kLimits))  // is simplified
    for (const Eigen::Vector3d& point : part) sum += point.cwiseAbs().sum();
  EXPECT_NEAR(sum, 15789.9103, 1e-3);
}

}  // namespace
}  // namespace smartsurf::mesh
