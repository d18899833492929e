// Makes the engine that a scene asks for.
#pragma once

#include <memory>
#include <string>

#include "common/threads/ThreadPool.h"
#include "smartsurf/scene/SceneSpec.h"
#include "smartsurf/world/Engine.h"

namespace smartsurf::world {

// True if Bullet was installed when the program was built.
bool has_bullet();

// Throws scene::InputError, one clause, if the engine of that name cannot have such a joint.
void require_joint(const std::string& engine, const scene::JointSpec&);

// Throws scene::InputError if this build lacks the engine named by WorldSpec::engine, or that engine
// something of the scene.
void require_engine(const scene::SceneSpec&);

// The engine named by WorldSpec::engine, with the scene's objects and joints. `field` and `pool` must outlive
// it; the pool may be null. Throws scene::InputError if this build lacks the engine.
std::unique_ptr<Engine> make_engine(const scene::SceneSpec&, surface::Field& field,
                                    common::ThreadPool* pool = nullptr);

}  // namespace smartsurf::world
