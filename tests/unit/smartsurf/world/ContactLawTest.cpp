#include "smartsurf/world/solver/ContactLaw-inl.h"

#include <gtest/gtest.h>

#include <bit>
#include <cstdint>
#include <random>

using namespace smartsurf::world;

namespace {

constexpr SubstepParams kParams{.h_s = 1.0F / 300,
                                .inverse_h = 300.0F,
                                .bias_rate = 20.0F,
                                .mass_scale = 0.9F,
                                .impulse_scale = 0.1F,
                                .steady_share = 0.5F,
                                .steady_gain = 0.25F,
                                .max_bias_velocity = 4.0F};

using V = law::LanesOf<float>;

struct Random {
  std::mt19937 bits{7};
  float operator()(float low, float high) { return std::uniform_real_distribution<float>(low, high)(bits); }
};

#if !defined(__SANITIZE_ADDRESS__) && !defined(__SANITIZE_THREAD__)
#define FILE_HAS_THE_LANES_INSTRUCTIONS 1  // sanitized builds give only kernels the larger set
void expect_bits(const V& lanes, int lane, float expected) {
  float values[kLanes];
  law::store(lanes, values, 0);
  EXPECT_EQ(std::bit_cast<std::uint32_t>(values[lane]), std::bit_cast<std::uint32_t>(expected)) << lane;
}
#endif

}  // namespace

#ifdef FILE_HAS_THE_LANES_INSTRUCTIONS
TEST(ContactLaw, LanesGiveTheBitsOfNumbers) {
  Random random;
  for (int round = 0; round < 100; ++round) {
    float separation[kLanes], old[kLanes], mass[kLanes], speed[kLanes], slip[3][kLanes], friction[3][kLanes];
    for (int i = 0; i < kLanes; ++i) {
      separation[i] = random(-0.3F, 0.1F), old[i] = random(0, 2), mass[i] = random(0.1F, 3);
      speed[i] = random(-3, 3);
      for (int k = 0; k < 3; ++k) slip[k][i] = random(-2, 2), friction[k][i] = random(-1, 1);
    }
    const V target = law::push_out_speed(law::load(separation, 0), kParams);
    const V impulse = law::normal_impulse(law::load(old, 0), law::load(mass, 0), law::load(speed, 0), target);
    const auto rubbing =
        law::friction_impulse(law::load3(friction, 0), law::load3(slip, 0), law::load(mass, 0), impulse);
    for (int i = 0; i < law::kWidthOf<float>; ++i) {
      const float target_i = law::push_out_speed(separation[i], kParams);
      const float impulse_i = law::normal_impulse(old[i], mass[i], speed[i], target_i);
      const law::Vector3<float> old_i{friction[0][i], friction[1][i], friction[2][i]},
          slip_i{slip[0][i], slip[1][i], slip[2][i]};
      const auto rubbing_i = law::friction_impulse(old_i, slip_i, mass[i], impulse_i);
      expect_bits(target, i, target_i);
      expect_bits(impulse, i, impulse_i);
      expect_bits(rubbing.x, i, rubbing_i.x);
      expect_bits(rubbing.y, i, rubbing_i.y);
      expect_bits(rubbing.z, i, rubbing_i.z);
    }
  }
}
#endif

TEST(ContactLaw, ASeparatedContactMayCloseItsGapAndNoMore) {
  const float gap = 0.01F, target = law::push_out_speed(gap, kParams);
  EXPECT_FLOAT_EQ(target * kParams.h_s, -gap);
  EXPECT_EQ(law::relax_target_speed(gap, target), target);
}

TEST(ContactLaw, AnOverlapIsPushedOutAtALimitedSpeedThatTheRelaxStageRemoves) {
  EXPECT_EQ(law::push_out_speed(-0.5F * kSlop, kParams), 0.0F);
  EXPECT_FLOAT_EQ(law::push_out_speed(-0.1F, kParams), (0.1F - kSlop) * kParams.bias_rate);
  EXPECT_EQ(law::push_out_speed(-1.0F, kParams), kParams.max_bias_velocity);
  EXPECT_EQ(law::relax_target_speed(-0.1F, 2.0F), 0.0F);
}

TEST(ContactLaw, TheNormalImpulseReachesTheTargetSpeedOrDoesNotPull) {
  const float mass = 2.0F, speed = -1.5F, target = 0.5F;
  EXPECT_FLOAT_EQ(speed + law::normal_impulse(0.0F, mass, speed, target) / mass, target);
  EXPECT_EQ(law::normal_impulse(0.5F, mass, 3.0F, target), 0.0F);
  EXPECT_FLOAT_EQ(law::normal_impulse(0.0F, mass, speed, target, 0.25F), 3.75F);
}

TEST(ContactLaw, OnlyTheImpulseBeyondTheSteadyShareDeflects) {
  EXPECT_FLOAT_EQ(law::deflecting_impulse(3.0F, 2.0F, kParams), 2.0F);
  EXPECT_EQ(law::deflecting_impulse(0.5F, 2.0F, kParams), 0.0F);
}

TEST(ContactLaw, FrictionStopsTheSlipWithinTheConeAndOpposesItBeyond) {
  const Vec3 old(0.1F, 0, 0), slip(0.3F, -0.4F, 0);
  const Vec3 stopping = law::friction_impulse(old, slip, 0.5F, 10.0F);
  EXPECT_TRUE(stopping.isApprox(Vec3(-0.05F, 0.2F, 0)));
  const Vec3 sliding = law::friction_impulse(Vec3(Vec3::Zero()), slip, 0.5F, 0.1F);
  EXPECT_FLOAT_EQ(sliding.norm(), 0.1F);
  EXPECT_FLOAT_EQ(sliding.dot(slip), -0.1F * slip.norm());
  EXPECT_TRUE(law::friction_impulse(old, slip, 0.5F, 0.0F).isZero(0.0F));
}

TEST(ContactLaw, TheTangentResponseIsTheGreaterEigenvalue) {
  Eigen::Matrix2f m;
  m << 2.0F, 0.7F, 0.7F, 1.0F;
  const float greatest = law::greatest_tangent_response(m(0, 0), m(1, 1), m(0, 1));
  EXPECT_NEAR((m - greatest * Eigen::Matrix2f::Identity()).determinant(), 0.0F, 1e-6F);
  EXPECT_GT(greatest, 0.5F * m.trace());
}
