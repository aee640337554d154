#pragma once
// The one glossary of frames and of how they stand in names.
//
//   W   world: z up, origin on the ground where the run starts
//   B   base, i.e. the pelvis (trunk) of a legged robot: x forward, y left, z up, origin at the trunk's reference point
//   H   heading: W turned about z by the yaw
//   L   leg: at the hip's roll axis, x forward, y down along the hanging leg, z left
//   F   foot: the tip of a leg's last link; G the point of the ground under it
//   C   centre of mass of the whole robot, axes of W
//   K   camera         A   base of an arm
//
//   p_WC    position of C from W's origin, expressed in W          [m]
//   p_BF_W  position of F from B's origin, expressed in W          [m]
//           (a last letter gives the axes where they are not the first letter's)
//   R_WB    rotation that takes components in B to components in W
//   T_WB    rigid transform (R_WB, p_WB)
//   v_WB    velocity of B's origin in W, in W                      [m/s]
//   w_WB_W  angular velocity of B in W, expressed in W             [rad/s]
//   f_F_W   force of the ground on F, in W                         [N]
//   L_C_W   angular momentum about C, in W                         [kg m^2/s]
// Six-vectors are angular first: twist (omega, v), wrench (moment, force), as in Lynch and Park, Modern Robotics.
// Everything is SI and radians; what is not carries a suffix, as solve_time_us. Quaternions are (w, x, y, z).
