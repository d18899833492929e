// Speeds that both engines share, in world units.
#pragma once

namespace smartsurf::world {

// Impacts below this approach speed do not rebound, pitches/s.
inline constexpr float kRestitutionThreshold = 0.2F;

// Errors of joints are corrected at no more than this, pitches/s; on Bullet those about an axis, rad/s.
inline constexpr double kMaxJointCorrectionSpeed = 4.0;

}  // namespace smartsurf::world
