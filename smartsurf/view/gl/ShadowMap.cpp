#include "smartsurf/view/gl/ShadowMap.h"

#include <algorithm>
#include <stdexcept>

#include "smartsurf/view/model/StageModel.h"

namespace smartsurf::view {

ShadowMap::ShadowMap(int size)
    : size_(size), depth_(make_texture()), depth_sampler_(make_sampler()), framebuffer_(make_framebuffer()) {
  glSamplerParameteri(depth_sampler_.id(), GL_TEXTURE_COMPARE_MODE, GL_NONE);
  glSamplerParameteri(depth_sampler_.id(), GL_TEXTURE_MIN_FILTER, GL_NEAREST);
  glSamplerParameteri(depth_sampler_.id(), GL_TEXTURE_MAG_FILTER, GL_NEAREST);
  glBindTexture(GL_TEXTURE_2D, depth_.id());
  glTexImage2D(GL_TEXTURE_2D, 0, GL_DEPTH_COMPONENT24, size, size, 0, GL_DEPTH_COMPONENT, GL_UNSIGNED_INT,
               nullptr);
  glTexParameteri(GL_TEXTURE_2D, GL_TEXTURE_MIN_FILTER, GL_LINEAR);
  glTexParameteri(GL_TEXTURE_2D, GL_TEXTURE_MAG_FILTER, GL_LINEAR);
  glTexParameteri(GL_TEXTURE_2D, GL_TEXTURE_WRAP_S, GL_CLAMP_TO_EDGE);
  glTexParameteri(GL_TEXTURE_2D, GL_TEXTURE_WRAP_T, GL_CLAMP_TO_EDGE);
  glTexParameteri(GL_TEXTURE_2D, GL_TEXTURE_COMPARE_MODE, GL_COMPARE_REF_TO_TEXTURE);
  glTexParameteri(GL_TEXTURE_2D, GL_TEXTURE_COMPARE_FUNC, GL_LEQUAL);
  glBindFramebuffer(GL_FRAMEBUFFER, framebuffer_.id());
  glFramebufferTexture2D(GL_FRAMEBUFFER, GL_DEPTH_ATTACHMENT, GL_TEXTURE_2D, depth_.id(), 0);
  glDrawBuffer(GL_NONE);
  glReadBuffer(GL_NONE);
  if (glCheckFramebufferStatus(GL_FRAMEBUFFER) != GL_FRAMEBUFFER_COMPLETE)
    throw std::runtime_error("OpenGL: the driver cannot render a shadow map");
  glBindFramebuffer(GL_FRAMEBUFFER, 0);
}

// An orthographic projection along the light. The area is a square, so that texels are square in the world.
void ShadowMap::fit(const Eigen::AlignedBox3d& box, double pitch) {
  const Eigen::Vector3d to_light = towards_sun();
  const Eigen::Vector3d right = Eigen::Vector3d::UnitZ().cross(to_light).normalized(),
                        up = to_light.cross(right);
  Eigen::Matrix3d rotation;
  rotation << right.transpose(), up.transpose(), to_light.transpose();
  Eigen::AlignedBox3d light_space_box;
  for (int i = 0; i < 8; ++i) {
    const Eigen::Vector3d corner((i & 1 ? box.max() : box.min()).x(), (i & 2 ? box.max() : box.min()).y(),
                                 (i & 4 ? box.max() : box.min()).z());
    light_space_box.extend(rotation * corner);
  }
  const double side = 1.01 * std::max(light_space_box.sizes().x(), light_space_box.sizes().y());
  const double depth = 1.05 * light_space_box.sizes().z();
  const Eigen::Vector3d scale(2.0 / side, 2.0 / side, -2.0 / depth);
  clip_from_world_.setIdentity();
  clip_from_world_.block<3, 3>(0, 0) = scale.asDiagonal() * rotation;
  clip_from_world_.block<3, 1>(0, 3) = -scale.cwiseProduct(light_space_box.center());
  texel_size_ = side / size_;
  penumbra_radius_ = std::max(0.10 * pitch, 1.5 * texel_size_);
  depth_range_ = depth;
  fitted_box_ = box;
}

// The footprint of the box, extended by where its top edge casts its shadow.
Eigen::AlignedBox2d ShadowMap::shadow_footprint(double z) const {
  const Eigen::Vector3d light = towards_sun();
  const Eigen::Vector2d offset = -light.head<2>() * (fitted_box_.max().z() - z) / light.z();
  const Eigen::AlignedBox2d footprint(fitted_box_.min().head<2>(), fitted_box_.max().head<2>());
  return footprint.merged(footprint.translated(offset));
}

Eigen::Matrix4f ShadowMap::texture_from_world() const {
  Eigen::Matrix4d half = Eigen::Matrix4d::Identity();
  half.block<3, 3>(0, 0) *= 0.5;
  half.block<3, 1>(0, 3).setConstant(0.5);
  return (half * clip_from_world_).cast<float>();
}

void ShadowMap::begin() const {
  glBindFramebuffer(GL_FRAMEBUFFER, framebuffer_.id());
  glViewport(0, 0, size_, size_);
  glClear(GL_DEPTH_BUFFER_BIT);
  // The depth offset prevents self-shadowing.
  glEnable(GL_POLYGON_OFFSET_FILL);
  glPolygonOffset(1.5f, 2.0f);
}

void ShadowMap::end() const { glDisable(GL_POLYGON_OFFSET_FILL); }

double ShadowMap::penumbra_spread() const { return kSunRadius * depth_range_; }

void ShadowMap::bind_depths(int unit) const {
  bind(unit);
  glBindSampler(static_cast<GLuint>(unit), depth_sampler_.id());
  glActiveTexture(GL_TEXTURE0);
}

void ShadowMap::bind(int unit) const {
  glActiveTexture(GL_TEXTURE0 + static_cast<GLenum>(unit));
  glBindTexture(GL_TEXTURE_2D, depth_.id());
}

}  // namespace smartsurf::view
