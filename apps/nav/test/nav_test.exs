defmodule NavTest do
  use ExUnit.Case, async: true
  doctest Nav
end
