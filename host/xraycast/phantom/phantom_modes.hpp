#pragma once

#include "xraycast/phantom/phantom_motion.hpp"

// The movements of the bodies. docs/motion.md lists their values, with sources.
namespace xraycast {

/// `breath` of the trunk, from the end of expiration to the end of a quiet inspiration.
PhantomMode breath_mode();

/// `heart` of the trunk, from an R wave to the next one.
PhantomMode heart_mode();

/// `turn` of the head, to the patient's left.
PhantomMode turn_mode();

}  // namespace xraycast
