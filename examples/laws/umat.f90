! A constitutive law for mpm that calls a UMAT of small strain. The UMAT here is an example: elastic, perfectly plastic von
! Mises.
!
!     gfortran -O2 -frecursive -shared -fPIC umat.f90 -o umat.so
!
! Copy this file, put your own UMAT in place of the one at the end, and change the module `description`. The header
! mpm_law.h describes the interface.
!
! The UMAT is called with three-dimensional tensors (NDI = 3, NSHR = 3, NTENS = 6) in the order 11, 22, 33, 12, 13, 23 and
! with engineering shear strains. At finite strain its strains are logarithmic, and its stress is the Kirchhoff stress.
!
! A UMAT advances the stress by a strain increment; mpm asks for the stress and the elastic strain at a trial elastic
! strain. The wrapper therefore keeps stress and strain of the UMAT among the history variables. A UMAT returns only the
! stress: the wrapper recovers the elastic strain as C^-1 STRESS, the inverse of isotropic linear elasticity with the
! parameters `young` and `poisson`, which must be those of the UMAT.
!
!     STRESS  stress at the start of the step          DSTRAN  trial elastic strain - C^-1 STRESS
!     STRAN   sum of DSTRAN of all steps before        DDSDDE  derivative of the stress with respect to DSTRAN
!     PROPS   all parameters, in their order           STATEV  history variables of the UMAT
!     SPD     plastic work per volume, for the columns of energy; a UMAT that leaves it at 0 causes warnings about energy
!
! STRESS + C DSTRAN is the exact trial stress, however the material rotates. STRESS, STRAN and tensors in STATEV do not
! rotate within a step, and DROT is the identity: a UMAT that uses them in other ways needs small steps where material
! rotates. TIME is 0 and DTIME is 1. A UMAT that sets PNEWDT below 1 refuses the increment, and the step is cut.
! Temperatures, coordinates and deformation gradients are not known here (zeros, identities): a UMAT that needs them cannot
! be used.
!
! mpm calls the law from several threads at once: a UMAT with SAVE, COMMON, DATA or initialised local variables gives wrong
! results. The option -frecursive keeps local arrays of threads apart.

! What is specific to the UMAT. Texts end with c_null_char.
module description
  use, intrinsic :: iso_c_binding, only: c_null_char
  implicit none
  integer, parameter :: n_parameters = 3, n_statev = 1
  ! The first two are those of the elasticity.
  character(len=32), target, save :: parameter_names(n_parameters) = [character(len=32) :: &
    'young'//c_null_char, 'poisson'//c_null_char, 'yield_stress'//c_null_char]
  character(len=32), target, save :: parameter_units(n_parameters) = [character(len=32) :: &
    'stress'//c_null_char, '-'//c_null_char, 'stress'//c_null_char]
  character(len=32), target, save :: statev_names(n_statev) = [character(len=32) :: &
    'equivalent_plastic_strain'//c_null_char]
  character(len=32), target, save :: statev_units(n_statev) = [character(len=32) :: '-'//c_null_char]
  double precision, parameter :: statev_initial(n_statev) = [0d0]
  character(len=80), parameter :: cmname = 'MATERIAL'
  ! False for a DDSDDE that is not symmetric, such as that of non-associated flow.
  logical, parameter :: tangent_is_symmetric = .true.
end module description

! The interface of mpm.
module interface_of_mpm
  use, intrinsic :: iso_c_binding
  use description
  implicit none

  ! History variables: the stress, the strain, the plastic work, and the variables of the UMAT.
  integer, parameter :: n_own = 13, n_history = n_own + n_statev
  character(len=32), target, save :: own_names(n_own) = [character(len=32) :: &
    'umat_stress_11'//c_null_char, 'umat_stress_22'//c_null_char, 'umat_stress_33'//c_null_char, &
    'umat_stress_12'//c_null_char, 'umat_stress_13'//c_null_char, 'umat_stress_23'//c_null_char, &
    'umat_strain_11'//c_null_char, 'umat_strain_22'//c_null_char, 'umat_strain_33'//c_null_char, &
    'umat_strain_12'//c_null_char, 'umat_strain_13'//c_null_char, 'umat_strain_23'//c_null_char, &
    'umat_plastic_work'//c_null_char]
  character(len=32), target, save :: own_units(n_own) = [character(len=32) :: &
    'stress'//c_null_char, 'stress'//c_null_char, 'stress'//c_null_char, &
    'stress'//c_null_char, 'stress'//c_null_char, 'stress'//c_null_char, &
    '-'//c_null_char, '-'//c_null_char, '-'//c_null_char, '-'//c_null_char, '-'//c_null_char, '-'//c_null_char, &
    'energy/volume'//c_null_char]

  ! Places of the components 11, 22, 33, 12, 13, 23 among xx, yy, zz, yz, xz, xy; also the other way round.
  integer, parameter :: place(6) = [1, 2, 3, 6, 5, 4]
  ! Engineering shear strains are twice the components of the tensor.
  double precision, parameter :: engineering(6) = [1d0, 1d0, 1d0, 2d0, 2d0, 2d0]

  type, bind(c) :: mpm_sizes
    integer(c_int64_t) :: size, n_parameters, n_history
  end type mpm_sizes

  type, bind(c) :: mpm_variable
    type(c_ptr) :: name, unit
    real(c_double) :: initial
  end type mpm_variable

contains

  integer(c_int32_t) function law_abi() bind(c, name='mpm_law_abi')
    law_abi = 1
  end function law_abi

  subroutine law_sizes(sizes) bind(c, name='mpm_law_sizes')
    type(mpm_sizes), intent(out) :: sizes
    sizes = mpm_sizes(c_sizeof(sizes), n_parameters, n_history)
  end subroutine law_sizes

  subroutine law_parameter(number, parameter_) bind(c, name='mpm_law_parameter')
    integer(c_int64_t), value :: number
    type(mpm_variable), intent(out) :: parameter_
    parameter_%name = c_loc(parameter_names(number + 1)(1:1))
    parameter_%unit = c_loc(parameter_units(number + 1)(1:1))
    parameter_%initial = 0d0
  end subroutine law_parameter

  subroutine law_history(number, variable) bind(c, name='mpm_law_history')
    integer(c_int64_t), value :: number
    type(mpm_variable), intent(out) :: variable
    integer :: place_in_statev
    place_in_statev = int(number) + 1 - n_own
    if (place_in_statev < 1) then
      variable%name = c_loc(own_names(number + 1)(1:1))
      variable%unit = c_loc(own_units(number + 1)(1:1))
      variable%initial = 0d0
    else
      variable%name = c_loc(statev_names(place_in_statev)(1:1))
      variable%unit = c_loc(statev_units(place_in_statev)(1:1))
      variable%initial = statev_initial(place_in_statev)
    end if
  end subroutine law_history

  ! The stress of an elastic strain by isotropic linear elasticity; strains have engineering shear.
  pure function elastic_stress(parameters, strain) result(stress)
    double precision, intent(in) :: parameters(n_parameters), strain(6)
    double precision :: stress(6), shear, lame
    shear = parameters(1) / (2d0 * (1d0 + parameters(2)))
    lame = parameters(1) * parameters(2) / ((1d0 + parameters(2)) * (1d0 - 2d0 * parameters(2)))
    stress(1:3) = lame * sum(strain(1:3)) + 2d0 * shear * strain(1:3)
    stress(4:6) = shear * strain(4:6)
  end function elastic_stress

  ! The inverse of elastic_stress.
  pure function elastic_strain_of(parameters, stress) result(strain)
    double precision, intent(in) :: parameters(n_parameters), stress(6)
    double precision :: strain(6)
    strain(1:3) = ((1d0 + parameters(2)) * stress(1:3) - parameters(2) * sum(stress(1:3))) / parameters(1)
    strain(4:6) = 2d0 * (1d0 + parameters(2)) / parameters(1) * stress(4:6)
  end function elastic_strain_of

  integer(c_int32_t) function law_update(parameters, trial, old_history, new_history, tau, elastic_strain, tangent) &
      bind(c, name='mpm_law_update')
    real(c_double), intent(in) :: parameters(n_parameters), trial(6), old_history(n_history)
    real(c_double), intent(out) :: new_history(n_history), tau(6), elastic_strain(6)
    ! The first index runs fastest: component (j, i) is the entry 6*i + j of mpm.
    real(c_double), intent(out) :: tangent(6, 6)
    external :: umat
    double precision :: stress(6), stran(6), dstran(6), ddsdde(6, 6), statev(n_statev), props(n_parameters)
    double precision :: sse, spd, scd, rpl, ddsddt(6), drplde(6), drpldt, time(2), dtime, temp, dtemp, predef(1), dpred(1)
    double precision :: coords(3), drot(3, 3), pnewdt, celent, dfgrd0(3, 3), dfgrd1(3, 3), recovered(6)
    integer :: i, j

    stress = old_history(1:6)
    stran = old_history(7:12)
    spd = old_history(13)
    statev = old_history(n_own + 1:)
    props = parameters
    dstran = trial(place) * engineering - elastic_strain_of(parameters, stress)
    ddsdde = 0d0
    sse = 0d0; scd = 0d0; rpl = 0d0; ddsddt = 0d0; drplde = 0d0; drpldt = 0d0
    time = 0d0; dtime = 1d0; temp = 0d0; dtemp = 0d0; predef = 0d0; dpred = 0d0; coords = 0d0
    drot = 0d0
    do i = 1, 3
      drot(i, i) = 1d0
    end do
    dfgrd0 = drot; dfgrd1 = drot
    pnewdt = 1d0; celent = 1d0
    call umat(stress, statev, ddsdde, sse, spd, scd, rpl, ddsddt, drplde, drpldt, stran, dstran, time, dtime, temp, dtemp, &
              predef, dpred, cmname, 3, 3, 6, n_statev, props, n_parameters, coords, drot, pnewdt, celent, dfgrd0, dfgrd1, &
              1, 1, 1, 1, 1, 1)
    new_history(1:6) = stress
    new_history(7:12) = stran + dstran
    new_history(13) = spd
    new_history(n_own + 1:) = statev
    tau = stress(place)
    recovered = elastic_strain_of(parameters, stress) / engineering
    elastic_strain = recovered(place)
    do i = 1, 6
      do j = 1, 6
        tangent(j, i) = ddsdde(place(i), place(j))
      end do
    end do
    law_update = merge(1_c_int32_t, 0_c_int32_t, pnewdt < 1d0)
  end function law_update

  integer(c_int32_t) function law_elastic_strain(parameters, tau, history, elastic_strain) &
      bind(c, name='mpm_law_elastic_strain')
    real(c_double), intent(in) :: parameters(n_parameters), tau(6), history(n_history)
    real(c_double), intent(out) :: elastic_strain(6)
    double precision :: strain(6)
    strain = elastic_strain_of(parameters, tau(place)) / engineering
    elastic_strain = strain(place)
    law_elastic_strain = 0
  end function law_elastic_strain

  real(c_double) function law_plastic_work(parameters, history) bind(c, name='mpm_law_plastic_work')
    real(c_double), intent(in) :: parameters(n_parameters), history(n_history)
    law_plastic_work = history(13)
  end function law_plastic_work

  ! A body with an initial stress begins with it.
  subroutine law_start(parameters, elastic_strain, volume_ratio, history) bind(c, name='mpm_law_start')
    real(c_double), intent(in) :: parameters(n_parameters), elastic_strain(6)
    real(c_double), value :: volume_ratio
    real(c_double), intent(inout) :: history(n_history)
    history(1:6) = elastic_stress(parameters, elastic_strain(place) * engineering)
  end subroutine law_start

  integer(c_int32_t) function law_tangent_is_symmetric(parameters) bind(c, name='mpm_law_tangent_is_symmetric')
    real(c_double), intent(in) :: parameters(n_parameters)
    law_tangent_is_symmetric = merge(1_c_int32_t, 0_c_int32_t, tangent_is_symmetric)
  end function law_tangent_is_symmetric

end module interface_of_mpm

! The example: linear elasticity, and von Mises yield at the uniaxial stress PROPS(3) without hardening.
! PROPS: Young's modulus, Poisson's ratio, yield stress. STATEV: equivalent plastic strain.
subroutine umat(stress, statev, ddsdde, sse, spd, scd, rpl, ddsddt, drplde, drpldt, stran, dstran, time, dtime, temp, &
                dtemp, predef, dpred, cmname, ndi, nshr, ntens, nstatv, props, nprops, coords, drot, pnewdt, celent, &
                dfgrd0, dfgrd1, noel, npt, layer, kspt, kstep, kinc)
  implicit none
  integer :: ndi, nshr, ntens, nstatv, nprops, noel, npt, layer, kspt, kstep, kinc
  character(len=80) :: cmname
  double precision :: stress(ntens), statev(nstatv), ddsdde(ntens, ntens), sse, spd, scd, rpl, ddsddt(ntens)
  double precision :: drplde(ntens), drpldt, stran(ntens), dstran(ntens), time(2), dtime, temp, dtemp, predef(1)
  double precision :: dpred(1), props(nprops)
  double precision :: coords(3), drot(3, 3), pnewdt, celent, dfgrd0(3, 3), dfgrd1(3, 3)
  double precision :: bulk, shear, mean, mises, scaled, flow, deviator(6), n(6)
  ! A stress beyond yield by less than this part is elastic, so that round-off does not choose between the tangents of a
  ! point that has yielded before.
  double precision, parameter :: on_surface = 1d-10
  integer :: i, j

  bulk = props(1) / (3d0 * (1d0 - 2d0 * props(2)))
  shear = props(1) / (2d0 * (1d0 + props(2)))

  ! Elastic predictor.
  ddsdde = 0d0
  do i = 1, 3
    do j = 1, 3
      ddsdde(i, j) = bulk - 2d0 / 3d0 * shear
    end do
    ddsdde(i, i) = bulk + 4d0 / 3d0 * shear
    ddsdde(i + 3, i + 3) = shear
  end do
  stress = stress + matmul(ddsdde, dstran)

  mean = sum(stress(1:3)) / 3d0
  deviator = stress
  deviator(1:3) = stress(1:3) - mean
  mises = sqrt(1.5d0 * (sum(deviator(1:3)**2) + 2d0 * sum(deviator(4:6)**2)))
  if (mises <= props(3) * (1d0 + on_surface)) return

  ! Radial return. The tangent is K I x I + 2 G s (1_dev - 3/2 n x n) with n = deviator / mises, s = yield stress / mises.
  scaled = props(3) / mises
  flow = (mises - props(3)) / (3d0 * shear)
  statev(1) = statev(1) + flow
  spd = spd + props(3) * flow
  stress = scaled * deviator
  stress(1:3) = stress(1:3) + mean
  n = deviator / mises
  do i = 1, 6
    do j = 1, 6
      ddsdde(i, j) = -3d0 * shear * scaled * n(i) * n(j)
      if (i <= 3 .and. j <= 3) ddsdde(i, j) = ddsdde(i, j) + bulk - 2d0 / 3d0 * shear * scaled
      if (i == j) ddsdde(i, j) = ddsdde(i, j) + merge(2d0, 1d0, i <= 3) * shear * scaled
    end do
  end do
end subroutine umat
