defmodule Sim.Trig do
  @moduledoc """
  Computes sine and cosine from additions and multiplications only, so that a run is identical to the bit on every
  machine, however its C library rounds. Accurate to a few 1e-16 for angles of a few turns. Pure.
  """

  @two_over_pi 0.6366197723675814
  # pi/2 in two parts, so that the remainder keeps its digits.
  @half_pi_high 1.5707963267341256
  @half_pi_low 6.077100506506192e-11

  @doc """
  `{cosine, sine}` of an angle in radians.

      iex> Sim.Trig.cos_sin(0.0)
      {1.0, 0.0}
      iex> {c, s} = Sim.Trig.cos_sin(2.5)
      iex> abs(c - :math.cos(2.5)) < 1.0e-15 and abs(s - :math.sin(2.5)) < 1.0e-15
      true
  """
  @spec cos_sin(float()) :: {float(), float()}
  def cos_sin(angle) do
    k = round(angle * @two_over_pi)
    r = angle - k * @half_pi_high - k * @half_pi_low
    z = r * r

    s =
      r +
        r * z *
          (-1 / 6 +
             z *
               (1 / 120 +
                  z *
                    (-1 / 5040 +
                       z *
                         (1 / 362_880 +
                            z *
                              (-1 / 39_916_800 +
                                 z * (1 / 6_227_020_800 + z * (-1 / 1_307_674_368_000)))))))

    c =
      1.0 +
        z *
          (-1 / 2 +
             z *
               (1 / 24 +
                  z *
                    (-1 / 720 +
                       z *
                         (1 / 40_320 +
                            z *
                              (-1 / 3_628_800 +
                                 z * (1 / 479_001_600 + z * (-1 / 87_178_291_200)))))))

    case Integer.mod(k, 4) do
      0 -> {c, s}
      1 -> {-s, c}
      2 -> {-c, -s}
      3 -> {s, -c}
    end
  end

  @doc """
  Tangent of an angle in radians.

      iex> abs(Sim.Trig.tan(:math.pi() / 4) - 1.0) < 1.0e-14
      true
  """
  @spec tan(float()) :: float()
  def tan(angle) do
    {c, s} = cos_sin(angle)
    s / c
  end
end
