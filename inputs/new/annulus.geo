// Triangles between two circles, for gmsh (https://gmsh.info):
//
//   gmsh -2 annulus.geo -o annulus.msh
//
// The names of the physical groups are what the deck calls its groups.
inner = 1;
outer = 2;
size = 0.25;

Point(1) = {0, 0, 0};
Point(2) = {inner, 0, 0, size};
Point(3) = {0, inner, 0, size};
Point(4) = {-inner, 0, 0, size};
Point(5) = {0, -inner, 0, size};
Point(6) = {outer, 0, 0, size};
Point(7) = {0, outer, 0, size};
Point(8) = {-outer, 0, 0, size};
Point(9) = {0, -outer, 0, size};

Circle(1) = {2, 1, 3};
Circle(2) = {3, 1, 4};
Circle(3) = {4, 1, 5};
Circle(4) = {5, 1, 2};
Circle(5) = {6, 1, 7};
Circle(6) = {7, 1, 8};
Circle(7) = {8, 1, 9};
Circle(8) = {9, 1, 6};
Curve Loop(1) = {1:4};
Curve Loop(2) = {5:8};
Plane Surface(1) = {2, 1};

Physical Curve("inner") = {1:4};
Physical Curve("outer") = {5:8};
Physical Surface("annulus") = {1};
