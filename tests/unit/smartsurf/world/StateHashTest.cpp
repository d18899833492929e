#include "common/threads/ThreadPool.h"
#include "smartsurf/world/StateHash.h"

#include <gtest/gtest.h>

#include <set>

namespace smartsurf::world {
namespace {

surface::Field field_of(int rows, int columns) {
  surface::Field field;
  field.rows = rows;
  field.columns = columns;
  for (int i = 0; i < rows * columns; ++i) {
    field.height.push_back(static_cast<float>(i));
    field.speed.push_back(0.5F * static_cast<float>(i % 7));
  }
  return field;
}

std::uint64_t hash_of(const surface::Field& field, int threads) {
  common::ThreadPool pool(threads, 0.0);  // always runs in parallel
  FieldHasher copy(&pool);
  std::vector<float> height;
  StateHash hash;
  copy.copy_and_hash(field, true, height, hash);
  EXPECT_EQ(height, field.height);
  return hash.value();
}

TEST(FieldHasher, SameCopyAndHashForAnyThreadCount) {
  for (const int rows : {1, 3, 101, 333}) {
    const surface::Field field = field_of(rows, 97);
    FieldHasher alone(nullptr);
    std::vector<float> height;
    StateHash hash;
    alone.copy_and_hash(field, true, height, hash);
    EXPECT_EQ(height, field.height);
    for (const int threads : {1, 2, 3}) EXPECT_EQ(hash_of(field, threads), hash.value()) << rows;
  }
}

TEST(FieldHasher, SameHashOfAnUnchangedField) {
  const surface::Field field = field_of(130, 97);
  FieldHasher hasher(nullptr);
  std::vector<float> height;
  for (const bool changed : {false, true, false}) {
    StateHash hash;
    height.clear();
    hasher.copy_and_hash(field, changed, height, hash);
    EXPECT_EQ(height, field.height);
    EXPECT_EQ(hash.value(), hash_of(field, 1));
  }
}

TEST(FieldHasher, HashDependsOnEveryHeightAndSpeed) {
  surface::Field field = field_of(130, 97);
  std::set<std::uint64_t> hashes{hash_of(field, 1)};
  for (const std::size_t cell : {0UL, 1UL, 31UL, 4095UL, 4096UL, field.height.size() - 1}) {
    field.height[cell] += 1.0F;
    EXPECT_TRUE(hashes.insert(hash_of(field, 1)).second) << "height " << cell;
    field.speed[cell] += 1.0F;
    EXPECT_TRUE(hashes.insert(hash_of(field, 1)).second) << "speed " << cell;
  }
  std::swap(field.height[40], field.height[72]);  // both go to the same chain of the hash
  EXPECT_TRUE(hashes.insert(hash_of(field, 1)).second) << "swapped";
}

}  // namespace
}  // namespace smartsurf::world
