// When a box certainly violates a plane, and when it certainly does not: the one derivation that the octrees, the
// search for a centre and the division of points rest on. There is no code here.
//
// A box with centre c and half edges h, and a plane a . x <= b with |a| = 1: over the box a . x - b runs from s - r to
// s + r, where s = a . c - b and r = sum |a_k| h_k. So s > r proves that all of the box violates the plane, s < -r that
// none of it does. Computed numbers differ from these; what they may differ by is added to r. Below u = 2^-53, to first
// order in u, and |a|_1 <= sqrt(3).
//
// 1. Cells of the unit cube, half edges h_l = 2^-(l + 1) at level l (plane_list.h, descent.h, octree.cpp).
//    s, the `value` of a plane, is that of the parent plus a . step. Products and sums of a . step are off by at most
//    3 u |a|_1 h_l, the addition by u |s|; a plane goes on to the children only where the parent has |s| <= r, so that
//    |s| <= 3 |a|_1 h_l here. That is 6 u |a|_1 h_l a level, over all levels below the cube less than 3 u |a|_1 < 6 u.
//    At the cube, s = (a_x + a_y + a_z) / 2 - b costs 2 u sqrt(3) / 2 + u |s|, less than 3 u for a plane that goes on.
//    (For one that is settled at once, u |s| cannot change the side of an s beyond r.) `reach`, the rounded |a|_1, is
//    off by 2 u |a|_1; its product with h_l is exact, as h_l is a power of two; adding the pad costs u r: together less
//    than 3 u. So a `pad` of 20 u and what the plane itself is off by on the cube covers everything at every level:
//        s > h reach + pad        all of the cell violates the plane,
//        s < -(h reach + pad)     none of it does.
//    The callers' pads are 64 u and more (`cube_planes` in Python), so that sums of pads and s, off by u pad, are
//    covered too. Where a list is made afresh for a cell (facet_lists.cpp), s = a . c - b with 0 <= c <= 1 costs 3 u
//    |a|_1 and u |s|, no more than at the cube and its levels above. Where the smallest cells are known to have half
//    edge v, a pad may be a part of the reach, |a|_1 + pad / v: h times that is at least h |a|_1 + pad for h >= v; its
//    sum is off by u r like the one above. At the centre of a cell h = 0: |s| > pad is certain.
//
// 2. Voxels of a brick of 8^3, half edge h (brick_columns.h). The column (x, y) crosses s = -r and s = r at
//        z = (-+r - s_000) / a'_z - (a'_x x + a'_y y) / a'_z,   a' = 2 h a, s_000 = s - 3.5 (a'_x + a'_y + a'_z).
//    In units of s, that is times |a'_z|: s_000 is off by less than 63 u h + u pad, as |s| <= 8 sqrt(3) h + pad in the
//    brick; its sum with r by 28 u h + 2 u pad; the inverse and the product with it by 56 u h + 4 u pad; the part of x
//    and y by 80 u h, as x, y <= 7; the last sum, between the clamps z = 0 and z = 8, by 16 u h. Together less than
//    250 u h + 8 u pad < 1e-13 h, which is added to r, for every pad up to 50 h.
//    A plane with |a'_z| < 2e-9 h is tilted to that: at the centres of voxels, |z - 3.5| <= 3.5 from that of the brick,
//    s changes by at most 7e-9 h. 1.6e-8 h is added to r.
//
// 3. The bounding box of a set of points (violation.cpp). n . x - d is known up to e (|x| + 1), where |x|_1 <= `far` in
//    the box. s is computed afresh: products and sums of n . c are off by 3 u far, the subtraction by u |s|, which
//    cannot change its side of r by more than u r; c is off by u far, from rounding. With E = e + 4 u, 2 E (far + 1)
//    covers all of that and e (far + 1); half edges longer by 1e-12 of themselves cover the rounding of r.
//    At a point E (|x|_1 + 1) covers e and the 3 u |x|_1 of its s.
#pragma once
