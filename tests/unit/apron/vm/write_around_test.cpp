// Which results may be stored around the caches: of planes too large for these, and read by no stage.
#include "apron/vm/WriteAround.h"

#include <gtest/gtest.h>

using namespace apron::vm;

namespace {

constexpr std::uint32_t kLarge = 4096;

MicroOp op_that_reads(std::uint32_t stream) {
  MicroOp op;
  op.args[0] = {MicroArg::Kind::kStream, 0, stream};
  return op;
}

// Two stages: register 0 → register 1 in place → register 2, fresh. Streams: 0 what is read, 1 what is
// written.
Plan chain(std::uint32_t side) {
  Plan plan;
  plan.width = plan.height = side;
  plan.stores = {{Store::Kind::kRegister, 0}, {Store::Kind::kInPlace, 1}, {Store::Kind::kFresh, 2}};
  for (std::uint32_t from = 0; from < 2; ++from) {
    Stage stage;
    stage.streams = {{from, 0}, {from + 1, 0}};
    stage.ops = {op_that_reads(0)};
    stage.results = {{0, 1}};
    plan.stages.push_back(stage);
  }
  return plan;
}

bool around(const Plan& plan, std::size_t stage) { return plan.stages[stage].results[0].around_caches; }

}  // namespace

TEST(WriteAround, WhatIsReadAgainStaysAndWhatIsNotGoesAround) {
  Plan plan = chain(kLarge);
  write_around_caches(plan);
  EXPECT_FALSE(around(plan, 0)) << "the next stage reads it";
  EXPECT_TRUE(around(plan, 1));
}

TEST(WriteAround, WhatFitsTheCachesStays) {
  Plan plan = chain(64);
  write_around_caches(plan);
  EXPECT_FALSE(around(plan, 0));
  EXPECT_FALSE(around(plan, 1));
}

TEST(WriteAround, APlaneWhoseOldRowsAreReadWhileItIsWrittenStays) {
  Plan plan = chain(kLarge);
  plan.stores.push_back({Store::Kind::kRegister, 1});  // register 1 as it was
  plan.stages[1].streams[0].store = 3;
  write_around_caches(plan);
  EXPECT_FALSE(around(plan, 0));
}

TEST(WriteAround, RingsNeverGoAround) {
  Plan plan = chain(kLarge);
  plan.stores[2].kind = Store::Kind::kRing;
  plan.stores[0].kind = plan.stores[1].kind = Store::Kind::kFresh;
  plan.width = 4 * kLarge;
  write_around_caches(plan);
  EXPECT_FALSE(around(plan, 1));
}
