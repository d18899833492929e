// Selection of non-temporal stores: results in planes larger than the caches that no stage reads.
#include "apron/vm/fusion/NonTemporalStores.h"

#include <gtest/gtest.h>

#include "apron/vm/fusion/FusionPlan.h"

using namespace apron::vm;

namespace {

constexpr std::uint32_t kLarge = 4096;

MicroOp reading_op(std::uint32_t stream) {
  MicroOp op;
  op.operands[0] = {MicroOperand::Kind::kStream, 0, stream};
  return op;
}

// Two stages: register 0 -> register 1 (in place) -> register 2 (double-buffered). In each, stream 0 is the
// input and stream 1 the output.
FusionPlan two_stage_plan(std::uint32_t side) {
  FusionPlan plan;
  plan.width = plan.height = side;
  plan.buffers = {
      {RowBuffer::Kind::kRegister, 0}, {RowBuffer::Kind::kInPlace, 1}, {RowBuffer::Kind::kDoubleBuffered, 2}};
  for (std::uint32_t from = 0; from < 2; ++from) {
    Stage stage;
    stage.streams = {{from, 0}, {from + 1, 0}};
    stage.ops = {reading_op(0)};
    stage.results = {{0, 1}};
    plan.stages.push_back(stage);
  }
  return plan;
}

void select(FusionPlan& plan) {
  select_non_temporal_stores(plan.stages, plan.buffers, std::size_t{plan.width} * plan.height);
}

bool is_non_temporal(const FusionPlan& plan, std::size_t stage) {
  return plan.stages[stage].results[0].non_temporal;
}

}  // namespace

TEST(NonTemporalStores, SelectsOnlyResultsThatNoStageReads) {
  FusionPlan plan = two_stage_plan(kLarge);
  select(plan);
  EXPECT_FALSE(is_non_temporal(plan, 0)) << "the next stage reads it";
  EXPECT_TRUE(is_non_temporal(plan, 1));
}

TEST(NonTemporalStores, KeepsPlanesThatFitInCache) {
  FusionPlan plan = two_stage_plan(64);
  select(plan);
  EXPECT_FALSE(is_non_temporal(plan, 0));
  EXPECT_FALSE(is_non_temporal(plan, 1));
}

TEST(NonTemporalStores, KeepsPlaneReadAtEntryByALaterStage) {
  FusionPlan plan = two_stage_plan(kLarge);
  plan.buffers.push_back({RowBuffer::Kind::kRegister, 1});  // register 1 at entry
  plan.stages[1].streams[0].buffer = 3;
  select(plan);
  EXPECT_FALSE(is_non_temporal(plan, 0));
}

TEST(NonTemporalStores, KeepsRingBuffers) {
  FusionPlan plan = two_stage_plan(kLarge);
  plan.buffers[2].kind = RowBuffer::Kind::kRing;
  plan.buffers[0].kind = plan.buffers[1].kind = RowBuffer::Kind::kDoubleBuffered;
  plan.width = 4 * kLarge;
  select(plan);
  EXPECT_FALSE(is_non_temporal(plan, 1));
}
