defmodule Console.Options.Page do
  @moduledoc "Decides where a page is served: the options of the commands that have one. Pure."
  alias Console.Page
  alias Console.Cli.Parse

  @doc "The rows for `Console.Cli.Arguments`."
  @spec table() :: [Console.Cli.Arguments.option()]
  def table do
    [
      {"page-address", "A", &address/1,
       "where the page is reached, such as 0.0.0.0, by other machines too (127.0.0.1)"},
      {"page-token", "T", &token/1, "what others must know to use the page: ?token=T"}
    ]
  end

  @doc "A port from a text."
  @spec port(String.t()) :: {:ok, :inet.port_number()} | {:error, String.t()}
  def port(text) do
    with {:error, _allowed} <- Parse.whole(text, 0..65_535),
         do: {:error, "a port from 0 to 65535"}
  end

  @doc "Who reaches the page may move robots: beyond this machine it needs a token."
  @spec check(:inet.ip_address(), String.t() | nil) :: :ok | {:error, line :: String.t()}
  def check(address, token) do
    if token != nil or Page.Access.loopback?(address),
      do: :ok,
      else:
        {:error,
         "--page-address of other machines needs --page-token: whoever knows it may command the robots"}
  end

  defp address(text) do
    with {:error, _reason} <- :inet.parse_ipv4strict_address(String.to_charlist(text)),
         do: {:error, "an IPv4 address of this machine"}
  end

  defp token(text) do
    if text =~ ~r/\A[A-Za-z0-9_-]{8,100}\z/,
      do: {:ok, text},
      else: {:error, "8 to 100 letters, digits, - and _"}
  end
end
